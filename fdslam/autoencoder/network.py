"""The convolutional autoencoder (AE) of one place and its input (§AD)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from itertools import pairwise

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn.utils import skip_init

from fdslam.errors import InputError
from fdslam.types import Image

BLOCKS = 4  # stride-2 blocks of the encoder
STEP = 2**BLOCKS  # pixels; the sides of the input are multiples of this
SLOPE = 0.1  # of the leaky rectifier below zero

Weights = dict[str, NDArray[np.float32]]


def _rectifier() -> nn.LeakyReLU:
    return nn.LeakyReLU(SLOPE, inplace=True)  # a copy of every layer's output would cost a twentieth of a step


class ConvAutoencoder(nn.Module):
    """A convolutional AE: four stride-2 blocks, a linear code, and the mirrored decoder (Hinton 2006; §AD).

    No normalisation layer: batches of one are common in small places, and GroupNorm, which was tried, removes the
    image's brightness and contrast before the code and reconstructs held-out images worse.
    """

    def __init__(
        self,
        size: tuple[int, int],
        channels: int,
        latent: int,
        generator: torch.Generator | None = None,
        draw: bool = True,
    ):
        """Build the network for inputs of ``size`` = (h, w) and draw its weights from ``generator`` (None: seed 0).

        The blocks have ``channels``, and 2, 4 and 8 times that; the code has length ``latent``. Without ``draw`` the
        weights are whatever lay in the memory, for one that loads others.

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
        self.encoder = nn.Sequential(*(layer for conv in down for layer in (conv, _rectifier())))
        self.encode = skip_init(nn.Linear, math.prod(self.grid), latent)
        self.decode = skip_init(nn.Linear, latent, math.prod(self.grid))
        self.decoder = nn.Sequential(
            *(layer for conv in up for layer in (nn.LeakyReLU(SLOPE, inplace=True), conv)), nn.Sigmoid()
        )
        if draw:
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


def weights_of(network: nn.Module) -> Weights:
    """Return a network's state as arrays of their own."""
    return {name: value.cpu().contiguous().numpy().copy() for name, value in network.state_dict().items()}


def network_with(weights: Mapping[str, NDArray[np.float32]], size: tuple[int, int]) -> ConvAutoencoder:
    """Return the network with the given weights for inputs of ``size`` = (h, w), on the CPU.

    Raises:
        InputError: the weights belong to another size of input, or are not those of this network.
    """
    try:
        channels, latent = len(weights["encoder.0.weight"]), len(weights["encode.weight"])
        network = ConvAutoencoder(size, channels, latent, draw=False)  # drawing takes as long as a look at an image
        network.load_state_dict({name: torch.from_numpy(np.array(value)) for name, value in weights.items()})
    except (KeyError, RuntimeError) as error:
        raise InputError(f"the weights do not fit the autoencoder of {size} pixels; train the map again") from error
    return network


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
