"""The convolutional autoencoder (AE) of one place, its trainer, and its reconstruction error (RE) as a score (§AD).

Nothing here keeps global state: every random number comes from a local generator, so places may be trained in parallel
threads and give the bytes they give one after the other. Weights are plain dicts of float32 arrays.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, pairwise

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn.utils import skip_init

from fdslam.config import Autoencoder
from fdslam.coverage import cell_maximum
from fdslam.errors import InputError
from fdslam.types import Cells, Image

BLOCKS = 4  # stride-2 blocks of the encoder
STEP = 2**BLOCKS  # pixels; the sides of the input are multiples of this
SLOPE = 0.1  # of the leaky rectifier below zero
SIGMA_FLOOR = 1 / 255  # one grey level: a smaller spread of the RE is not measurable in 8-bit images
GAIN = 1e-5  # a held-out loss counts as better only if it falls by this much
SHIFT = 1  # pixels of the AE's input; largest shift of the augmentation
LIGHT = 0.15  # strength of the photometric augmentation
HELD_BATCH = 16  # held-out images that go through the network at once

Weights = dict[str, NDArray[np.float32]]


class ConvAutoencoder(nn.Module):
    """A convolutional AE: four stride-2 blocks, a linear code, and the mirrored decoder (Hinton 2006; §AD).

    No normalisation layer: batches of one are common in small places, and GroupNorm, which was tried, removes the
    image's brightness and contrast before the code and reconstructs held-out images worse.
    """

    def __init__(self, size: tuple[int, int], channels: int, latent: int, generator: torch.Generator | None = None):
        """Build the network for inputs of ``size`` = (h, w) and draw its weights from ``generator`` (None: seed 0).

        The blocks have ``channels``, and 2, 4 and 8 times that; the code has length ``latent``.

        Raises:
            InputError: a side is not a positive multiple of 16.
        """
        super().__init__()
        if any(side < STEP or side % STEP for side in size):
            raise InputError(f"the autoencoder's input {size} must have sides that are multiples of {STEP}")
        widths = [3, *(channels * 2**i for i in range(BLOCKS))]
        pairs = list(pairwise(widths))
        self.grid = (widths[-1], size[0] // STEP, size[1] // STEP)
        down = [skip_init(nn.Conv2d, a, b, 3, stride=2, padding=1) for a, b in pairs]
        up = [skip_init(nn.ConvTranspose2d, b, a, 4, stride=2, padding=1) for a, b in reversed(pairs)]
        self.encoder = nn.Sequential(*(layer for conv in down for layer in (conv, nn.LeakyReLU(SLOPE))))
        self.encode = skip_init(nn.Linear, math.prod(self.grid), latent)
        self.decode = skip_init(nn.Linear, latent, math.prod(self.grid))
        self.decoder = nn.Sequential(*(layer for conv in up for layer in (nn.LeakyReLU(SLOPE), conv)), nn.Sigmoid())
        self._draw(generator or torch.Generator().manual_seed(0))

    def _draw(self, generator: torch.Generator) -> None:
        """Draw the weights after He et al. 2015, biases 0."""
        # torch's own rule shrinks the signal from layer to layer: the training then starts with a plateau of grey.
        for layer in self.modules():
            if isinstance(layer, nn.Conv2d | nn.ConvTranspose2d | nn.Linear):
                fan_in = layer.weight[0].numel()
                if isinstance(layer, nn.ConvTranspose2d):  # at stride 2 an output pixel sees 2×2 of the 4×4 taps
                    fan_in = layer.in_channels * 4
                bound = math.sqrt(6 / (fan_in * (1 + SLOPE**2)))
                nn.init.uniform_(layer.weight, -bound, bound, generator=generator)
                if layer.bias is not None:
                    nn.init.zeros_(layer.bias)

    def forward(self, images: Tensor) -> Tensor:
        """Reconstruct images: [n, 3, h, w] float32 in 0..1 to the same shape, type and range."""
        # Channels last in memory (the shapes stay): the convolutions are a fifth faster on a CPU.
        features = self.encoder(images.contiguous(memory_format=torch.channels_last))
        code = self.encode(features.flatten(1))
        return self.decoder(self.decode(code).unflatten(1, self.grid).contiguous(memory_format=torch.channels_last))


@dataclass(frozen=True)
class PlaceModel:
    """The AE of one place and the statistics that make its RE comparable with that of others."""

    weights: Weights  # state of ConvAutoencoder, float32
    mu: float | None  # mean of the held-out RE, grey levels of 0..1; None: there was nothing to hold out
    sigma: float | None  # standard deviation of it, at least SIGMA_FLOOR; None with mu
    epochs: int  # the final model was trained for
    training: NDArray[np.float32]  # [epochs] L1 of the final model on its augmented images
    validation: NDArray[np.float32]  # [folds] best held-out L1 of each fold; empty without one
    own_mu: float  # mean of the final model's RE on its own training images, grey levels of 0..1
    own_sigma: float  # standard deviation of it, at least SIGMA_FLOOR


def input_size(height: int, width: int, pixels: int) -> tuple[int, int]:
    """Return (h, w) of the AE's input: the nearest multiples of 16 to the image's aspect at an area of ``pixels``."""
    exact = math.sqrt(pixels * height / width), math.sqrt(pixels * width / height)
    if min(exact) < STEP:  # a strip: the short side cannot shrink further, so the long one gives way to keep the area
        exact = tuple(STEP if side < STEP else pixels / STEP for side in exact)
    rows, columns = (max(1, round(side / STEP)) * STEP for side in exact)
    return rows, columns


def prepare(images: Iterable[Image], size: tuple[int, int]) -> Tensor:
    """Return n images [H, W, 3] uint8 RGB as the AE's input [n, 3, h, w] float32 in 0..1; ``size`` is (h, w).

    They are taken one at a time, so that those of a large place need not be in memory together.
    """
    height, width = size
    small = [cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA) for image in images]
    stacked = np.stack(small) if small else np.zeros((0, height, width, 3), np.uint8)
    return torch.from_numpy(stacked).permute(0, 3, 1, 2).to(torch.float32) / 255


def fit_place(images: Tensor, config: Autoencoder, seed: int, device: str = "cpu") -> PlaceModel:
    """Train the AE of one place and measure its RE on images it has not seen (§AD).

    Cross-fitting: each fold is held out once from an AE that stops when that fold's L1 no longer falls; the held-out
    RE of all folds gives μ and σ, and the final AE sees all images for the mean of the folds' best epochs. The folds
    are contiguous blocks along the path, because neighbouring frames are near-duplicates: with a shuffled split, the
    twin of a held-out frame would be trained on and μ would be far too small.

    Args:
        images: [n, 3, h, w] float32 in 0..1, in the order of the path, n >= 1, on the CPU.
        config: sizes and training.
        seed: of weights, order and augmentation.
        device: where torch runs.

    Returns:
        The model. With a single image nothing can be held out: ``mu`` and ``sigma`` are None, to be filled by
        ``fill_statistics``, and the training runs for ``config.epochs``. Equal bytes for equal arguments on a CPU
        with one thread, in whatever thread it runs.

    Raises:
        InputError: no image.
    """
    if len(images) == 0:
        raise InputError("an autoencoder needs at least one image of its place")
    images = images.to(device)
    held = fold_slices(len(images), config.folds)
    fitted = [_fit_fold(images, block, config, (seed, fold)) for fold, block in enumerate(held)]
    epochs = max(1, round(sum(f[0] for f in fitted) / len(fitted))) if fitted else config.epochs
    network, generator = _start(images, config, (seed, len(fitted)), device)
    training = np.array(list(islice(_epochs(network, images, config, generator), epochs)), dtype=np.float32)
    mu, sigma = statistics(np.concatenate([f[2] for f in fitted])) if fitted else (None, None)
    own_mu, own_sigma = statistics(_error(network, images, HELD_BATCH))
    weights = {name: value.cpu().contiguous().numpy().copy() for name, value in network.state_dict().items()}
    validation = np.array([f[1] for f in fitted], dtype=np.float32)
    return PlaceModel(weights, mu, sigma, epochs, training, validation, own_mu, own_sigma)


def fold_slices(count: int, folds: int) -> list[slice]:
    """Return the held-out block of every fold: min(folds, count) contiguous slices, none for a single image."""
    if count < 2:
        return []
    folds = min(folds, count)
    return [slice(i * count // folds, (i + 1) * count // folds) for i in range(folds)]


def _fit_fold(
    images: Tensor, held: slice, config: Autoencoder, seed: tuple[int, int]
) -> tuple[int, float, NDArray[np.float32]]:
    """Train without ``held``; return its best epoch, its best loss and the RE [n, h, w] of that epoch."""
    train = torch.cat([images[: held.start], images[held.stop :]])
    network, generator = _start(train, config, seed, images.device)
    best = 0, math.inf, np.empty(0, dtype=np.float32)
    for epoch, _ in enumerate(_epochs(network, train, config, generator), start=1):
        error = _error(network, images[held], HELD_BATCH)
        loss = float(error.mean(dtype=np.float64))
        if loss < best[1] - GAIN:
            best = epoch, loss, error
        if epoch >= config.epochs or epoch - best[0] >= config.patience:
            break
    if best[0] == 0:
        raise InputError(f"the autoencoder's training diverged: learning_rate={config.learning_rate} is too high")
    return best


def _start(
    images: Tensor, config: Autoencoder, seed: tuple[int, int], device: str | torch.device
) -> tuple[ConvAutoencoder, torch.Generator]:
    """Return a fresh network on ``device`` and the CPU generator that goes on to drive its training."""
    # Seed and number of the fold are mixed, or fold 1 of seed 0 would be fold 0 of seed 1.
    generator = torch.Generator().manual_seed(int(np.random.SeedSequence(seed).generate_state(1)[0]))
    size = images.shape[2], images.shape[3]
    return ConvAutoencoder(size, config.channels, config.latent, generator).to(device), generator


def _epochs(
    network: ConvAutoencoder, images: Tensor, config: Autoencoder, generator: torch.Generator
) -> Iterator[float]:
    """Train with Adam on the L1 loss for as long as asked; yield each epoch's mean loss."""
    optimiser = torch.optim.Adam(network.parameters(), lr=config.learning_rate, fused=True)
    while True:
        total = 0.0
        for batch in torch.randperm(len(images), generator=generator).split(config.batch):
            inputs = augment(images[batch.to(images.device)], generator)
            loss = nn.functional.l1_loss(network(inputs), inputs)
            optimiser.zero_grad(set_to_none=True)
            loss.backward()
            optimiser.step()
            total += float(loss.detach()) * len(batch)
        yield total / len(images)


def augment(images: Tensor, generator: torch.Generator) -> Tensor:
    """Shift images [n, 3, h, w] by up to ``SHIFT`` pixels and change gamma, contrast and brightness by ``LIGHT``.

    Each image on its own, into a new tensor in 0..1. No mirroring: places are not symmetric.
    """
    count, _, height, width = images.shape
    offsets = torch.randint(0, 2 * SHIFT + 1, (count, 2), generator=generator).tolist()
    padded = nn.functional.pad(images, (SHIFT,) * 4, mode="replicate")
    shifted = torch.stack([padded[i, :, y : y + height, x : x + width] for i, (y, x) in enumerate(offsets)])
    light = (LIGHT * (2 * torch.rand(3, count, 1, 1, 1, generator=generator) - 1)).to(images.device)
    gamma, contrast, brightness = torch.exp(3 * light[0]), 1 + light[1], light[2] / 2
    return ((shifted.clamp(1e-3, 1) ** gamma - 0.5) * contrast + 0.5 + brightness).clamp(0, 1)


def _error(network: ConvAutoencoder, images: Tensor, batch: int) -> NDArray[np.float32]:
    """Return the RE [n, h, w] of images on the network's device: |I − I′| averaged over the channels."""
    with torch.no_grad():
        parts = [(network(part) - part).abs().mean(dim=1).cpu() for part in images.split(batch)]
    return torch.cat(parts).numpy() if len(images) else np.empty((0, *images.shape[2:]), dtype=np.float32)


def statistics(errors: NDArray[np.float32]) -> tuple[float, float]:
    """Return mean and standard deviation of the RE over all pixels, the latter at least ``SIGMA_FLOOR``."""
    return float(errors.mean(dtype=np.float64)), max(float(errors.std(dtype=np.float64)), SIGMA_FLOOR)


def fill_statistics(models: Sequence[PlaceModel]) -> tuple[PlaceModel, ...]:
    """Give the places of one image the mean μ and the mean σ of the other places; order is kept, no None is left.

    Where no place could hold anything out, each takes the RE on its own training image: too small, but by about the
    same factor everywhere, so that the AEs stay comparable (§AD).
    """
    measured = [(model.mu, model.sigma) for model in models if model.mu is not None and model.sigma is not None]
    mean = np.mean(measured, axis=0).tolist() if measured else None

    def fill(model: PlaceModel) -> PlaceModel:
        if model.mu is not None and model.sigma is not None:
            return model
        mu, sigma = mean or (model.own_mu, model.own_sigma)
        return replace(model, mu=mu, sigma=sigma)

    return tuple(map(fill, models))


def reconstruction_error(
    weights: Mapping[str, NDArray[np.float32]], images: Tensor, device: str = "cpu"
) -> NDArray[np.float32]:
    """Return the RE of images under the AE with the given weights (§AD, V_RE at each pixel).

    Images go through one at a time: the last bits of a convolution depend on the batch's size, and a query's score
    must not depend on the queries that come with it.

    Args:
        weights: of ``PlaceModel``.
        images: [n, 3, h, w] float32 in 0..1, of the size that the AE was trained at.
        device: where torch runs.

    Returns:
        [n, h, w] float32 in 0..1, |I − I′| averaged over the channels.

    Raises:
        InputError: the weights belong to another size of input, or are not those of this network.
    """
    try:
        channels, latent = len(weights["encoder.0.weight"]), len(weights["encode.weight"])
        network = ConvAutoencoder((images.shape[2], images.shape[3]), channels, latent)
        network.load_state_dict({name: torch.from_numpy(np.array(value)) for name, value in weights.items()})
    except (KeyError, RuntimeError) as error:
        size = tuple(images.shape[2:])
        raise InputError(f"the weights do not fit the autoencoder of {size} pixels; train the map again") from error
    return _error(network.to(device), images.to(device), 1)


def z_score(error: NDArray[np.float32], mu: float, sigma: float) -> NDArray[np.float32]:
    """Return (RE − μ) / σ, float32, of ``error``'s shape; the caller divides by c, which all AEs share (§AD)."""
    return ((error.astype(np.float64) - mu) / sigma).astype(np.float32)


def error_to_cells(error: NDArray[np.float32], height: int, width: int) -> Cells:
    """Return the largest RE or z of every cell of an image of ``height`` × ``width`` pixels (§Performance).

    ``error`` [h, w] float32, at the AE's resolution, is resized bilinearly between pixel centres; a cell takes the
    maximum of its pixels.
    """
    return cell_maximum(np.asarray(cv2.resize(error, (width, height), interpolation=cv2.INTER_LINEAR), np.float32))
