"""All networks trained in one batched pass: the weights of G networks lie in stacks [G, ...] (§AD).

Convolutions are grouped, the codes are batched matrix products, Adam works on the stacks. Networks with the most
batches come first, so that those with a batch left are always the first of the stacks: a view, no copy. What one
network has fewer of, images in a batch or epochs, is padded with weight 0 or taken out of the stacks.

It pays where starting a kernel costs more than running it, on a GPU. On a CPU oneDNN's grouped convolutions are slower
than one convolution after the other, which already runs near the machine's rate (experiments/speed/autoencoders.py).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F
from torch.optim.adam import adam

from fdslam.autoencoder.augmentation import augment, draw
from fdslam.autoencoder.checkpoint import Keeper
from fdslam.autoencoder.job import Job
from fdslam.autoencoder.network import SLOPE
from fdslam.autoencoder.scoring import HELD_BATCH
from fdslam.store import Arrays

BETA1, BETA2, EPSILON = 0.9, 0.999, 1e-8  # of Adam, torch's defaults
Stack = dict[str, Tensor]  # name of a parameter -> [G, ...]


def train_together(jobs: Sequence[Job], device: str, keeper: Keeper, name: str) -> None:
    """Train all jobs to their ends in one batched pass, with Adam on the L1 loss.

    Each network sees the images, the order and the augmentation that it would see alone; its numbers differ from
    those of ``train_apart`` by rounding, which may depend on the networks beside it.

    Args:
        jobs: what is to be trained, all of one configuration and one size of images; they hold the result.
        device: where torch runs.
        keeper: of checkpoints.
        name: of these jobs, for the keeper.
    """
    networks = [job.network() for job in jobs]
    fleet = _Fleet(jobs, networks, device)
    kept = keeper.load(name)
    if kept is not None:
        for number, job in enumerate(jobs):
            prefix = f"{number}/"
            job.restore({n.removeprefix(prefix): a for n, a in kept.items() if n.startswith(prefix)})
        fleet.restore(kept)
    fleet.drop_finished()
    while fleet.numbers:
        fleet.epoch()
        done = fleet.drop_finished()
        if (done and not fleet.numbers) or keeper.due(name):
            states = {f"{i}/{n}": a for i, job in enumerate(jobs) for n, a in job.state().items()}
            keeper.save(name, states | fleet.state())


class _Fleet:
    """The networks in training, most batches first."""

    def __init__(self, jobs: Sequence[Job], networks: Sequence[nn.Module], device: str) -> None:
        self.jobs, self.device = jobs, device
        self.rate, self.batch = jobs[0].config.learning_rate, jobs[0].config.batch
        # Which jobs lie in the stacks, in their order.
        self.numbers = sorted(range(len(jobs)), key=lambda i: -len(jobs[i].images))
        states = [networks[i].state_dict() for i in self.numbers]
        self.weights: Stack = {n: torch.stack([s[n] for s in states]).to(device) for n in states[0]}
        self.mean = {n: torch.zeros_like(w) for n, w in self.weights.items()}
        self.square = {n: torch.zeros_like(w) for n, w in self.weights.items()}
        # Of Adam, for each parameter: torch counts the steps of each by itself.
        self.steps = {n: torch.zeros(len(jobs), device=device) for n in self.weights}
        self.images = [torch.cat([j.images, *([] if j.held is None else [j.held])]) for j in jobs]
        self.first = np.cumsum([0, *map(len, self.images)])  # of each job among all images
        self.pool = torch.cat(self.images).to(device)

    def epoch(self) -> None:
        """Train every network for one epoch, then look at what is held out from it."""
        batches = [self.jobs[i].shuffled() for i in self.numbers]
        totals = torch.zeros(len(self.numbers), dtype=torch.float64)
        for step in range(len(batches[0])):
            now = [(i, b[step]) for i, b in zip(self.numbers, batches, strict=False) if len(b) > step]
            totals[: len(now)] += self._step(now).cpu().double() * torch.tensor([len(b) for _, b in now])
        outputs = self._held_out()
        for i, total in zip(self.numbers, totals.tolist(), strict=True):
            self.jobs[i].end_epoch(total / len(self.jobs[i].images), outputs.get(i))

    def _step(self, now: list[tuple[int, Tensor]]) -> Tensor:
        """Take one step with the first networks of the stacks; return their losses, [len(now)]."""
        size = max(len(batch) for _, batch in now)
        index = torch.zeros(len(now), size, dtype=torch.int64)
        parameters = torch.zeros(len(now), size, 5)  # zeros change nothing
        weight = torch.zeros(len(now), size)
        for row, (i, batch) in enumerate(now):
            index[row, : len(batch)] = batch + int(self.first[i])
            parameters[row, : len(batch)] = draw(len(batch), self.jobs[i].generator)
            weight[row, : len(batch)] = 1 / len(batch)
        inputs = augment(self.pool[index.flatten().to(self.device)], parameters.flatten(0, 1))
        inputs = inputs.unflatten(0, index.shape)
        leaves = {n: w[: len(now)].detach().requires_grad_() for n, w in self.weights.items()}
        each = (forward(leaves, inputs) - inputs).abs().mean(dim=(2, 3, 4))  # [networks, images]
        losses = (each * weight.to(self.device)).sum(dim=1)
        gradients = torch.autograd.grad(losses.sum(), [*leaves.values()])
        self._adam(dict(zip(leaves, gradients, strict=True)), len(now))
        return losses.detach()

    @torch.no_grad()
    def _adam(self, gradients: Stack, count: int) -> None:
        """Follow the gradients of the first ``count`` networks (Kingma and Ba 2015).

        Every network's share of a stack is a parameter of its own to torch, as networks differ in their steps.
        """
        # In the order of the weights in memory: the fused step goes by it alone.
        gradients = {name: gradient.contiguous() for name, gradient in gradients.items()}
        rows, names = range(count), [*gradients]
        adam(
            [self.weights[name][row] for name in names for row in rows],
            [gradients[name][row] for name in names for row in rows],
            [self.mean[name][row] for name in names for row in rows],
            [self.square[name][row] for name in names for row in rows],
            [],
            [self.steps[name][row] for name in names for row in rows],
            fused=True,
            amsgrad=False,
            beta1=BETA1,
            beta2=BETA2,
            lr=self.rate,
            weight_decay=0.0,
            eps=EPSILON,
            maximize=False,
        )

    @torch.no_grad()
    def _held_out(self) -> dict[int, Tensor]:
        """Return, per job that holds images out, their reconstructions, on the CPU."""
        counts = {i: len(self.jobs[i].held) for i in self.numbers if self.jobs[i].held is not None}  # type: ignore[arg-type]
        parts: dict[int, list[Tensor]] = {i: [] for i in counts}
        for begin in range(0, max(counts.values(), default=0), HELD_BATCH):
            size = min(HELD_BATCH, max(counts.values()) - begin)
            index = torch.zeros(len(self.numbers), size, dtype=torch.int64)
            for row, i in enumerate(self.numbers):
                there = max(0, min(size, counts.get(i, 0) - begin))
                start = int(self.first[i]) + len(self.jobs[i].images) + begin
                index[row, :there] = torch.arange(start, start + there)
            images = self.pool[index.flatten().to(self.device)].unflatten(0, index.shape)
            outputs = forward(self.weights, images).cpu()
            for row, i in enumerate(self.numbers):
                if i in counts and counts[i] > begin:
                    parts[i].append(outputs[row, : counts[i] - begin])
        return {i: torch.cat(found) for i, found in parts.items()}

    def drop_finished(self) -> bool:
        """Take networks that are trained to the end out of the stacks; tell whether there were any."""
        going = [row for row, i in enumerate(self.numbers) if not self.jobs[i].finished]
        if len(going) == len(self.numbers):
            return False
        for row, i in enumerate(self.numbers):
            if row not in going and self.jobs[i].held is None and not self.jobs[i].weights:
                self.jobs[i].weights = {n: w[row].cpu().numpy().copy() for n, w in self.weights.items()}
        kept = torch.tensor(going, dtype=torch.int64, device=self.device)
        for stack in self._stacks().values():
            for name, value in stack.items():
                stack[name] = value.index_select(0, kept)
        self.numbers = [self.numbers[r] for r in going]
        return True

    def _stacks(self) -> dict[str, Stack]:
        return {"weights": self.weights, "mean": self.mean, "square": self.square, "steps": self.steps}

    def state(self) -> Arrays:
        """Return the stacks, for a checkpoint."""
        arrays: Arrays = {"numbers": np.array(self.numbers, np.int64)}
        for part, stack in self._stacks().items():
            arrays |= {f"stack.{part}.{name}": value.cpu().numpy().copy() for name, value in stack.items()}
        return arrays

    def restore(self, arrays: Arrays) -> None:
        """Go on from a checkpoint."""
        self.numbers = arrays["numbers"].tolist()
        for part, stack in self._stacks().items():
            for name in stack:
                stack[name] = torch.from_numpy(arrays[f"stack.{part}.{name}"].copy()).to(self.device)


def forward(weights: Stack, images: Tensor) -> Tensor:
    """Reconstruct images, those of each network by that network: what ``ConvAutoencoder.forward`` does, G times.

    Args:
        weights: of G networks.
        images: [G, n, 3, h, w] float32 in 0..1.

    Returns:
        [G, n, 3, h, w] float32 in 0..1.
    """
    groups = len(images)
    grid = (-1, images.shape[3] // 16, images.shape[4] // 16)
    last = torch.channels_last

    def convolve(op: Callable[..., Tensor], x: Tensor, layer: str) -> Tensor:
        weight, bias = weights[f"{layer}.weight"].flatten(0, 1), weights[f"{layer}.bias"].flatten()
        return op(x, weight, bias, stride=2, padding=1, groups=groups)

    def multiply(x: Tensor, layer: str) -> Tensor:
        return torch.baddbmm(weights[f"{layer}.bias"][:, None], x, weights[f"{layer}.weight"].transpose(1, 2))

    # [n, G·C, h, w]: the channels of all networks side by side.
    features = images.transpose(0, 1).flatten(1, 2).contiguous(memory_format=last)
    for block in range(0, 8, 2):
        features = F.leaky_relu_(convolve(F.conv2d, features, f"encoder.{block}"), SLOPE)
    code = multiply(features.unflatten(1, (groups, -1)).transpose(0, 1).flatten(2), "encode")
    features = multiply(code, "decode").unflatten(2, grid).transpose(0, 1).flatten(1, 2)
    features = features.contiguous(memory_format=last)
    for block in range(1, 9, 2):
        features = convolve(F.conv_transpose2d, F.leaky_relu_(features, SLOPE), f"decoder.{block}")
    return torch.sigmoid(features).unflatten(1, (groups, 3)).transpose(0, 1)
