"""Signs of centred descriptors, packed: what a map keeps of an image's looks.

A descriptor is centred on the map's mean and each bit is the sign of one channel. Where there are more channels than
bits, they are scaled to unit variance and turned by a fixed random rotation, and the bits are the signs of its first
coordinates (random-hyperplane hashing, Charikar 2002).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.compact.source import Level
from fdslam.store import Arrays

Signs = NDArray[np.uint64]  # [rows, cols, words] bits, padded with 0
WORD = 64  # bits


@dataclass(frozen=True)
class Centring:
    """What makes bits of the descriptors of one stride."""

    mean: NDArray[np.float32]  # [channels]
    turn: NDArray[np.float32]  # [channels, bits] projection of centred descriptors; [0, 0]: none is needed

    @property
    def bits(self) -> int:
        """Number of bits of a descriptor."""
        return self.turn.shape[1] or len(self.mean)

    def signs(self, values: Level) -> Signs:
        """Return the bits of descriptors, uint64 [rows, cols, ⌈bits / 64⌉]."""
        centred = values - self.mean
        positive = (centred @ self.turn if self.turn.size else centred) > 0
        empty = -positive.shape[2] % WORD
        packed = np.packbits(np.pad(positive, ((0, 0), (0, 0), (0, empty))), axis=2)
        return np.ascontiguousarray(packed).view(np.uint64)

    def arrays(self, name: str) -> Arrays:
        """Return it for storage under a name."""
        return {f"{name}.mean": self.mean, f"{name}.turn": self.turn}


def centring(levels: Iterable[Level], bits: int) -> Centring:
    """Fit the centring of one stride to the descriptors of a map's images.

    Args:
        levels: descriptors of each image.
        bits: most that a descriptor may have.
    """
    sums, squares, count = np.zeros(0), np.zeros(0), 0
    for values in levels:
        rows = values.reshape(-1, values.shape[2]).astype(np.float64)
        sums = sums + rows.sum(axis=0) if count else rows.sum(axis=0)
        squares = squares + (rows**2).sum(axis=0) if count else (rows**2).sum(axis=0)
        count += len(rows)
    mean = sums / count
    if len(mean) <= bits:
        return Centring(mean.astype(np.float32), np.zeros((0, 0), np.float32))
    deviation = np.sqrt(np.maximum(squares / count - mean**2, 0))
    rotation = np.linalg.qr(np.random.default_rng(0).standard_normal((len(mean), bits)))[0]
    turn = rotation / np.maximum(deviation, 1e-6)[:, None]
    return Centring(mean.astype(np.float32), turn.astype(np.float32))


def stored(arrays: Arrays, name: str) -> Centring:
    """Return what ``Centring.arrays`` gave."""
    return Centring(arrays[f"{name}.mean"], arrays[f"{name}.turn"])
