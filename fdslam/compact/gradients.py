"""Dense descriptors without a network: oriented gradients over 3 × 3 places, and log intensity.

A place is a cell of the stride. Its orientations are those of the gradient of log intensity, which a change of the
light by a factor leaves alone, summed by magnitude; the nine log intensities are told relative to their mean.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.compact.canvas import STRIDES, Canvas, canvas_of
from fdslam.compact.grid import Grid
from fdslam.compact.source import Level
from fdslam.config import Dense
from fdslam.types import Image

ORIENTATIONS = (6, 12)  # at the fine and the coarse stride: of half a turn, and of a whole one
DARK = 8.0  # grey levels: added before the logarithm, or noise in the dark would be texture
PLACES = [(dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1)]


class Gradients:
    """Oriented gradients as a source."""

    def __init__(self, config: Dense) -> None:
        self.config = config

    @property
    def identity(self) -> dict[str, Any]:
        """What decides the descriptors of an image."""
        return {"source": "gradients", "kilobytes": self.config.kilobytes}

    def _canvas(self, height: int, width: int) -> Canvas:
        return canvas_of(height, width, 0, 0, self.config)

    def grids(self, height: int, width: int) -> tuple[Grid, Grid]:
        """Return where the descriptors of an image of that size lie."""
        return grids_of(self._canvas(height, width), height, width)

    def describe(self, image: Image) -> tuple[Level, Level]:
        """Return the fine and the coarse descriptors of an image."""
        canvas = self._canvas(*image.shape[:2])
        grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
        scaled = cv2.resize(grey, (canvas.width, canvas.height), interpolation=cv2.INTER_AREA)
        light = np.log(scaled.astype(np.float32) + DARK)
        dx, dy = (
            cv2.Sobel(light, cv2.CV_32F, *order, ksize=3, borderType=cv2.BORDER_REPLICATE) for order in ((1, 0), (0, 1))
        )
        fine, coarse = (
            _described(light, dx, dy, stride, bins) for stride, bins in zip(STRIDES, ORIENTATIONS, strict=True)
        )
        return fine, coarse


def grids_of(canvas: Canvas, height: int, width: int) -> tuple[Grid, Grid]:
    """Return the grids of both strides over an image of that size, pixels."""
    fine, coarse = (
        Grid(*canvas.grid_shape(stride), stride * width / canvas.width, stride * height / canvas.height)
        for stride in STRIDES
    )
    return fine, coarse


def _described(light: NDArray, dx: NDArray, dy: NDArray, stride: int, bins: int) -> Level:
    rows, cols = (-(-side // stride) for side in light.shape)
    cell = np.add.outer(np.arange(light.shape[0]) // stride * cols, np.arange(light.shape[1]) // stride).ravel()
    pixels = np.bincount(cell, minlength=rows * cols)
    intensity = np.bincount(cell, light.ravel(), rows * cols) / pixels
    turn = np.pi if stride == STRIDES[0] else 2 * np.pi
    angle, size = (np.arctan2(dy, dx) % turn / turn * bins).ravel(), np.hypot(dx, dy).ravel()
    low = angle.astype(np.int64)
    share = angle - low
    total = rows * cols * bins
    sums = np.bincount(cell * bins + low % bins, size * (1 - share), total)
    sums += np.bincount(cell * bins + (low + 1) % bins, size * share, total)  # between two orientations: of both
    histogram = sums.reshape(-1, bins) / pixels[:, None]
    padded = np.pad(
        np.concatenate([intensity[:, None], histogram], axis=1).reshape(rows, cols, -1),
        ((1, 1), (1, 1), (0, 0)),
        mode="edge",
    )
    around = np.stack([padded[1 + y : 1 + y + rows, 1 + x : 1 + x + cols] for y, x in PLACES], axis=2)
    relative = around[..., 0] - around[..., 0].mean(axis=2, keepdims=True)
    gradient = around[..., 1:].reshape(rows, cols, -1)
    gradient = gradient - gradient.mean(axis=2, keepdims=True)
    return np.concatenate([gradient, relative], axis=2).astype(np.float32)
