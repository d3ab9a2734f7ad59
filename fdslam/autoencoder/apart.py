"""Networks trained one after the other, each as if alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import nn

from fdslam.autoencoder.augmentation import augment, draw
from fdslam.autoencoder.checkpoint import Keeper
from fdslam.autoencoder.job import Job
from fdslam.autoencoder.network import ConvAutoencoder, weights_of
from fdslam.autoencoder.scoring import HELD_BATCH, reconstruct
from fdslam.store import Arrays


def train_apart(jobs: Sequence[Job], device: str, keeper: Keeper, name: str) -> None:
    """Train every job to its end, with Adam on the L1 loss; on a CPU the bytes are those of each job alone.

    Args:
        jobs: what is to be trained; they hold the result.
        device: where torch runs.
        keeper: of checkpoints.
        name: of these jobs, for the keeper.
    """
    for number, job in enumerate(jobs):
        _train(job, device, keeper, f"{name}.{number}")


def _train(job: Job, device: str, keeper: Keeper, name: str) -> None:
    network = job.network().to(device)
    optimiser = torch.optim.Adam(network.parameters(), lr=job.config.learning_rate, fused=True)
    if (kept := keeper.load(name)) is not None:
        job.restore(kept)
        if not job.finished:
            _restore(network, optimiser, kept)
    images = job.images.to(device)
    held = None if job.held is None else job.held.to(device)
    while not job.finished:
        total = 0.0
        for batch in job.shuffled():
            inputs = augment(images[batch.to(device)], draw(len(batch), job.generator))
            loss = nn.functional.l1_loss(network(inputs), inputs)
            optimiser.zero_grad(set_to_none=True)
            loss.backward()
            optimiser.step()
            total += float(loss.detach()) * len(batch)
        job.end_epoch(total / len(images), None if held is None else reconstruct(network, held, HELD_BATCH))
        if job.finished:
            job.weights = weights_of(network) if held is None else {}
            keeper.save(name, job.state())
        elif keeper.due(name):
            keeper.save(name, job.state() | _state(network, optimiser))


def _state(network: ConvAutoencoder, optimiser: torch.optim.Adam) -> Arrays:
    arrays: Arrays = {f"network.{name}": value for name, value in weights_of(network).items()}
    for name, parameter in network.named_parameters():
        for part, value in optimiser.state[parameter].items():  # step, exp_avg, exp_avg_sq
            arrays[f"adam.{part}.{name}"] = value.cpu().numpy().copy()
    return arrays


def _restore(network: ConvAutoencoder, optimiser: torch.optim.Adam, arrays: Arrays) -> None:
    network.load_state_dict({n: torch.from_numpy(arrays[f"network.{n}"].copy()) for n in network.state_dict()})
    parts = ("step", "exp_avg", "exp_avg_sq")
    state = {
        i: {part: torch.from_numpy(np.array(arrays[f"adam.{part}.{name}"])) for part in parts}
        for i, (name, _) in enumerate(network.named_parameters())
    }
    optimiser.load_state_dict({"state": state, "param_groups": optimiser.state_dict()["param_groups"]})
