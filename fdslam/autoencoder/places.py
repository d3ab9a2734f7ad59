"""The AEs of places: cross-fitting inside each gives μ, σ and the number of epochs; then all its images train (§AD)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from fdslam.autoencoder.apart import train_apart
from fdslam.autoencoder.checkpoint import Forgetful, Keeper
from fdslam.autoencoder.job import Job
from fdslam.autoencoder.network import Weights, network_with
from fdslam.autoencoder.scoring import HELD_BATCH, Statistics, reconstruct, statistics
from fdslam.config import Autoencoder
from fdslam.errors import InputError

Trainer = Callable[[Sequence[Job], str, Keeper, str], None]  # train_apart or train_together


@dataclass(frozen=True)
class PlaceModel:
    """The AE of one place and the statistics that make its RE comparable with that of others."""

    weights: Weights  # state of ConvAutoencoder, float32
    held_out: Statistics  # of the RE on images that were held out; empty where there was nothing to hold out
    own: Statistics  # of the final model's RE on its own training images
    epochs: int  # the final model was trained for
    training: NDArray[np.float32]  # [epochs] L1 of the final model on its augmented images
    validation: NDArray[np.float32]  # [folds] best held-out L1 of each fold; empty without one


def fit_places(
    places: Sequence[Tensor],
    config: Autoencoder,
    seed: int,
    device: str = "cpu",
    train: Trainer = train_apart,
    keeper: Keeper | None = None,
    names: Sequence[str] = (),
) -> list[PlaceModel]:
    """Train the AE of every place and measure its RE on images it has not seen (§AD).

    Cross-fitting: each fold is held out once from an AE that stops when that fold's L1 no longer falls; the held-out
    RE of all folds gives μ and σ, and the final AE sees all images for the mean of the folds' best epochs. The folds
    are contiguous blocks along the path, because neighbouring frames are near-duplicates: with a shuffled split, the
    twin of a held-out frame would be trained on and μ would be far too small.

    Args:
        places: per place [n, 3, h, w] float32 in 0..1, in the order of the path, n >= 1, on the CPU.
        config: sizes and training.
        seed: of weights, order and augmentation.
        device: where torch runs.
        train: ``train_apart`` or ``train_together``.
        keeper: of checkpoints; None: none are kept.
        names: of the places, for messages; none: their numbers.

    Returns:
        The models. With a single image nothing can be held out: ``held_out`` is empty, to be filled by
        ``fill_statistics``, and the training runs for ``config.epochs``. With ``train_apart``, equal bytes for equal
        arguments on a CPU with one thread, in whatever thread and beside whatever places it runs.

    Raises:
        InputError: a place without an image, or a training that diverged.
    """
    if any(len(images) == 0 for images in places):
        raise InputError("an autoencoder needs at least one image of its place")
    keeper = keeper or Forgetful()
    names = names or [f"place {place}" for place in range(len(places))]
    folds = [_folds(images, config, seed, name) for images, name in zip(places, names, strict=True)]
    train([job for jobs in folds for job in jobs], device, keeper, "folds") if any(folds) else None
    finals = []
    for images, jobs, name in zip(places, folds, names, strict=True):
        epochs = max(1, round(sum(job.best[0] for job in jobs) / len(jobs))) if jobs else config.epochs
        finals.append(Job(images, None, epochs, (seed, len(jobs)), config, name))
    train(finals, device, keeper, "finals")
    return [_model(final, jobs, device) for final, jobs in zip(finals, folds, strict=True)]


def _folds(images: Tensor, config: Autoencoder, seed: int, name: str) -> list[Job]:
    """Return the trainings that hold out a fold each."""
    found = []
    for fold, block in enumerate(fold_slices(len(images), config.folds)):
        rest = torch.cat([images[: block.start], images[block.stop :]])
        found.append(Job(rest, images[block], config.epochs, (seed, fold), config, name))
    return found


def _model(final: Job, folds: list[Job], device: str) -> PlaceModel:
    held = [(job.held, job.outputs) for job in folds if job.held is not None and job.outputs is not None]
    images = final.images.to(device)
    network = network_with(final.weights, (images.shape[2], images.shape[3])).to(device)
    own = statistics(images, reconstruct(network, images, HELD_BATCH))
    # The last step's weights are in no loss.
    if not np.isfinite([*own.values()]).all() or not all(np.isfinite(value).all() for value in final.weights.values()):
        raise final.diverged()
    return PlaceModel(
        final.weights,
        statistics(torch.cat([h for h, _ in held]), torch.cat([o for _, o in held])) if held else {},
        own,
        final.epoch,
        final.training(),
        np.array([job.best[1] for job in folds], dtype=np.float32),
    )


def fold_slices(count: int, folds: int) -> list[slice]:
    """Return the held-out block of every fold: min(folds, count) contiguous slices, none for a single image."""
    if count < 2:
        return []
    folds = min(folds, count)
    return [slice(i * count // folds, (i + 1) * count // folds) for i in range(folds)]


def fill_statistics(models: Sequence[PlaceModel]) -> tuple[PlaceModel, ...]:
    """Give the places of one image the mean μ and the mean σ of the other places; order is kept, none stays empty.

    Where no place could hold anything out, each takes the RE on its own training image: too small, but by about the
    same factor everywhere, so that the AEs stay comparable (§AD).
    """
    measured = [model.held_out for model in models if model.held_out]

    def fill(model: PlaceModel) -> PlaceModel:
        if model.held_out:
            return model
        if not measured:
            return replace(model, held_out=model.own)
        means = {kind: np.mean([one[kind] for one in measured], axis=0).tolist() for kind in measured[0]}
        return replace(model, held_out={kind: (mu, sigma) for kind, (mu, sigma) in means.items()})

    return tuple(map(fill, models))
