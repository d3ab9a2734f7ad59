"""One training of one network: what is shown to it, when it stops, and what is kept of it.

The place's final network and the network of each held-out fold are such jobs. A job has a random generator of its own,
so that it goes the same way whichever jobs are trained beside it, and can be written down after any epoch and go on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from fdslam.autoencoder.network import ConvAutoencoder, Weights
from fdslam.config import Autoencoder
from fdslam.errors import InputError
from fdslam.store import Arrays

GAIN = 1e-5  # a held-out loss counts as better only if it falls by this much


def seeded(seed: tuple[int, int]) -> torch.Generator:
    """Return a generator for a seed and the number of a fold."""
    # They are mixed, or fold 1 of seed 0 would be fold 0 of seed 1.
    return torch.Generator().manual_seed(int(np.random.SeedSequence(seed).generate_state(1)[0]))


@dataclass
class Job:
    """A network to train; the state that changes is what a checkpoint holds, beside weights and optimiser."""

    images: Tensor  # [n, 3, h, w] float32 in 0..1 on the CPU: those trained on
    held: Tensor | None  # [m, 3, h, w], likewise: held out, they decide when to stop; None: all epochs are run
    epochs: int  # at most
    seed: tuple[int, int]
    config: Autoencoder
    place: str = "a place"  # for messages
    generator: torch.Generator = field(init=False)
    losses: list[float] = field(default_factory=list)  # L1 of each epoch
    best: tuple[int, float] = (0, math.inf)  # epoch, counted from 1, and its held-out L1
    outputs: Tensor | None = None  # [m, 3, h, w] reconstructions of the held-out images at that epoch, on the CPU
    weights: Weights = field(default_factory=dict)  # of the last epoch, once it is finished and nothing is held out

    def __post_init__(self) -> None:
        """Seed the generator."""
        self.generator = seeded(self.seed)

    def network(self) -> ConvAutoencoder:
        """Return the network before its first epoch, on the CPU; its weights are the first that is drawn."""
        size = self.images.shape[2], self.images.shape[3]
        return ConvAutoencoder(size, self.config.channels, self.config.latent, self.generator)

    def shuffled(self) -> tuple[Tensor, ...]:
        """Return the next epoch's batches: indices into the images."""
        return torch.randperm(len(self.images), generator=self.generator).split(self.config.batch)

    @property
    def epoch(self) -> int:
        """Number of finished epochs."""
        return len(self.losses)

    @property
    def finished(self) -> bool:
        """Whether there is nothing more to train."""
        waited = self.epoch - self.best[0] >= self.config.patience
        return self.epoch >= self.epochs or (self.held is not None and waited)

    def end_epoch(self, loss: float, outputs: Tensor | None) -> None:
        """Note an epoch's loss and, with held-out images, their reconstructions after it.

        Raises:
            InputError: the loss of a final network is not finite, or the training has ended without ever being better
                than nothing.
        """
        self.losses.append(loss)
        if self.held is None and not math.isfinite(loss):
            raise self.diverged()
        if self.held is not None and outputs is not None:
            outputs = outputs.cpu()
            held = float((outputs - self.held).abs().mean(dim=1).numpy().mean(dtype=np.float64))
            if held < self.best[1] - GAIN:
                self.best, self.outputs = (self.epoch, held), outputs.clone()
            if self.finished and self.best[0] == 0:
                raise self.diverged()

    def diverged(self) -> InputError:
        """Return what to raise where a training led nowhere."""
        return InputError(
            f"the autoencoder of {self.place} diverged in epoch {self.epoch}: ad.learning_rate="
            f"{self.config.learning_rate} is too high; lower it and run again"
        )

    def state(self) -> Arrays:
        """Return what changes, for a checkpoint."""
        arrays: Arrays = {
            "generator": self.generator.get_state().numpy(),
            "losses": np.array(self.losses, np.float64),
            "best_epoch": np.array(self.best[0]),
            "best_loss": np.array(self.best[1]),
        }
        if self.outputs is not None:
            arrays["outputs"] = self.outputs.contiguous().numpy()
        return arrays | {f"weights.{name}": value for name, value in self.weights.items()}

    def restore(self, arrays: Arrays) -> None:
        """Go on from a checkpoint."""
        self.generator.set_state(torch.from_numpy(arrays["generator"].copy()))
        self.losses = arrays["losses"].tolist()
        self.best = int(arrays["best_epoch"]), float(arrays["best_loss"])
        self.outputs = torch.from_numpy(arrays["outputs"].copy()) if "outputs" in arrays else None
        self.weights = {n.removeprefix("weights."): a for n, a in arrays.items() if n.startswith("weights.")}

    def training(self) -> NDArray[np.float32]:
        """Return the loss of each epoch, float32."""
        return np.array(self.losses, dtype=np.float32)
