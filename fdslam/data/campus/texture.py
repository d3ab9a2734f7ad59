"""Textures, made on first use, with their reduced copies; and the noise they are painted with."""

from __future__ import annotations

import threading
from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

Color = tuple[float, float, float]  # RGB, 0..255


class Texture:
    """An image [h, w, 3 or 4] uint8 (the fourth channel cuts: below 128 is a hole) and its ripmap.

    A ripmap halves width and height independently: a facade that runs away from the viewer is squeezed in one direction
    only, and an ordinary mipmap would blur the other too.
    """

    def __init__(self, make: Callable[[], NDArray[np.uint8]]) -> None:
        self._make = make
        self._levels: dict[tuple[int, int], NDArray[np.uint8]] = {}
        self._lock = threading.Lock()

    def level(self, lx: int, ly: int) -> NDArray[np.uint8]:
        """Return the texture halved ``lx`` times in width and ``ly`` times in height (at most down to one pixel)."""
        found = self._levels.get((lx, ly))
        if found is not None:
            return found
        with self._lock:
            base = self._levels.get((0, 0))
            if base is None:
                base = self._levels[0, 0] = np.ascontiguousarray(self._make())
            size = max(1, base.shape[1] >> lx), max(1, base.shape[0] >> ly)
            level = base if (lx, ly) == (0, 0) else cv2.resize(base, size, interpolation=cv2.INTER_AREA)
            self._levels[lx, ly] = np.asarray(level, np.uint8)
        return self._levels[lx, ly]


def noise(rng: np.random.Generator, height: int, width: int, cells: float, octaves: int = 3) -> NDArray[np.float32]:
    """Return smooth noise [height, width] in about -1..1.

    Args:
        rng: where it comes from.
        height: pixels.
        width: pixels.
        cells: blobs of the coarsest octave along the longer side.
        octaves: each doubles the frequency and halves the height.
    """
    out = np.zeros((height, width), np.float32)
    side = max(height, width)
    for k in range(octaves):
        n = cells * 2**k
        h, w = max(2, round(n * height / side)), max(2, round(n * width / side))
        grid = rng.uniform(-1, 1, (h, w)).astype(np.float32)
        out += cv2.resize(grid, (width, height), interpolation=cv2.INTER_CUBIC) * 0.5**k
    return out / np.float32(1.4)


def to_bytes(image: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Round and clip to 0..255."""
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def shift(color: Color, amount: float) -> Color:
    """Return the colour, brighter (amount > 0) or darker by that share."""
    r, g, b = (min(255.0, max(0.0, c * (1 + amount))) for c in color)
    return r, g, b


def plain(color: Color, size: int = 8) -> Texture:
    """Return a texture of one colour."""
    return Texture(lambda: np.full((size, size, 3), np.rint(color), np.uint8))
