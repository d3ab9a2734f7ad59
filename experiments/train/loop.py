"""What both trainings share: options, the schedule of the step size, and the running average of the weights."""

from __future__ import annotations

import argparse
import copy
import os
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
import torch
from safetensors.torch import load_file, save_file
from torch import Tensor, nn

from experiments.train.views import HEIGHT, STORE, TEST, TRAINING, VALIDATION, WIDTH

WEIGHTS = Path(__file__).parents[2] / "fdslam" / "weights"


def options(doc: str | None, epochs: Sequence[int], batch: int) -> argparse.ArgumentParser:
    """Return the parser of the options that both scripts have; the defaults made the shipped models."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    add = parser.add_argument
    add("--store", type=Path, default=STORE, help="folder that keeps the rendered views and the trained network")
    add("--out", type=Path, default=WEIGHTS, help="folder of the exported model")
    add("--device", default="cpu", help="cpu, cuda")
    add("--threads", type=int, default=os.cpu_count() or 1, help="of torch, and processes that render")
    add("--seed", type=int, default=0, help="of the training")
    add("--epochs", type=int, nargs=len(epochs), default=epochs, help="of each round; the step size rises anew in each")
    add("--batch", type=int, default=batch)
    add("--done", type=int, default=0, help="rounds not to do again: their network is taken from the store")
    add("--seeds", type=int, nargs="+", default=TRAINING, help="campuses to train on")
    add("--validation", type=int, nargs="+", default=VALIDATION, help="campuses looked at after each epoch")
    add("--test", type=int, nargs="+", default=TEST, help="campuses looked at once, at the end")
    add("--every", type=int, default=2, help="of the 96 views of a session, every how many")
    add("--height", type=int, default=HEIGHT, help="of a view, pixels")
    add("--width", type=int, default=WIDTH, help="of a view, pixels")
    return parser


def prepare(args: argparse.Namespace) -> None:
    """Seed everything, and keep torch and OpenCV to their threads."""
    torch.manual_seed(args.seed)
    torch.set_num_threads(args.threads)
    cv2.setNumThreads(1)


class Average:
    """The running average of a network's weights and statistics, which is what is tested and shipped.

    Args:
        net: the network.
        decay: how much of the average a step keeps, in the end; the first steps keep less.
    """

    def __init__(self, net: nn.Module, decay: float = 0.995) -> None:
        self.net, self.decay, self.steps = copy.deepcopy(net).eval().requires_grad_(False), decay, 0

    @torch.no_grad()
    def update(self, net: nn.Module) -> None:
        """Follow the network by one step."""
        self.steps += 1
        keep = min(self.decay, self.steps / (self.steps + 10))
        for mine, theirs in zip(self.net.state_dict().values(), net.state_dict().values(), strict=True):
            if mine.dtype.is_floating_point:
                mine.lerp_(theirs, 1 - keep)
            else:
                mine.copy_(theirs)


def rounds(
    net: nn.Module, args: argparse.Namespace, name: str, train_round: Callable[[nn.Module, int], nn.Module]
) -> nn.Module:
    """Do the rounds of a training that are not done, and keep the network of each in the store.

    Args:
        net: before the first.
        args: of ``options``.
        name: of the model.
        train_round: trains a network, in round 0, 1 and so on, and returns its average.
    """

    def kept(number: int) -> Path:
        return args.store / f"{name}_{number}.safetensors"

    if args.done:
        net.load_state_dict(load_file(kept(args.done - 1)))
    for number in range(args.done, len(args.epochs)):
        net = train_round(net, number)
        save_file({k: v.contiguous() for k, v in net.state_dict().items()}, kept(number))
    return net


def train(
    net: nn.Module,
    epochs: int,
    rate: float,
    epoch_of: Callable[[int], Iterator[Callable[[nn.Module], Tensor]]],
    steps: int,
    check: Callable[[nn.Module], str],
) -> nn.Module:
    """Train with AdamW, a linear rise of the step size and a cosine down to nothing; return the average.

    Args:
        net: the network, on its device.
        epochs: of this round.
        rate: largest step size.
        epoch_of: yields, of an epoch, the function from the network to the loss of each batch.
        steps: batches of an epoch.
        check: measures the average after an epoch.
    """
    net.requires_grad_(True)
    for module in net.modules():
        if isinstance(module, nn.BatchNorm2d):
            module.momentum = 0.03  # short trainings: torchvision's 0.01 is too slow
    plain = [p for p in net.parameters() if p.ndim < 2]
    decayed = [p for p in net.parameters() if p.ndim >= 2]
    groups = [{"params": decayed, "weight_decay": 0.02}, {"params": plain, "weight_decay": 0.0}]
    optimizer = torch.optim.AdamW(groups, lr=rate)
    total, rise = epochs * steps, max(1, min(100, epochs * steps // 10))
    schedule = torch.optim.lr_scheduler.LambdaLR(
        optimizer, lambda k: min((k + 1) / rise, 0.5 + 0.5 * float(np.cos(np.pi * min(1.0, k / total))))
    )
    average, start = Average(net), time.monotonic()
    for epoch in range(epochs):
        net.train()
        losses = []
        for k, loss_of in enumerate(epoch_of(epoch)):
            loss = loss_of(net)
            optimizer.zero_grad(set_to_none=True)
            loss.backward()
            nn.utils.clip_grad_norm_(net.parameters(), 10.0)
            optimizer.step()
            schedule.step()
            average.update(net)
            losses.append(loss.item())
            if k % 50 == 49:
                seconds = time.monotonic() - start
                print(
                    f"epoch {epoch} step {k + 1}/{steps} loss {np.mean(losses[-50:]):.3f} {seconds:.0f} s", flush=True
                )
        print(f"epoch {epoch}: {check(average.net)}; {time.monotonic() - start:.0f} s", flush=True)
    return average.net
