"""Compact comparison: how unlike the map a query looks, by Hamming distances around the predicted places.

Every descriptor is compared with those of a map image at all whole displacements from its predicted place. The
smallest distance over the displacements is noisy, as each cell may choose its own: *supported*, distances of equal
displacements are first averaged over the cells around by a Gaussian, as the cost volumes of stereo matching are.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.compact.grid import Grid
from fdslam.compact.signs import Signs
from fdslam.native import NATIVE, njit
from fdslam.popcount import bits_set

NOWHERE = np.float32(np.inf)  # no descriptor of the map image is around
_EXACT = 1e-9  # of a cell: what rounding may take from a place that is exactly ``reach`` away


def displaced(
    query: Signs, image: Signs, grid: Grid, at: NDArray[np.floating], reach: float
) -> Iterator[tuple[NDArray[np.float32], NDArray[np.bool_]]]:
    """Yield, for every displacement, the distances of a query's descriptors to those of a map image.

    Args:
        query: uint64 [rows, cols, words].
        image: uint64 [rows', cols', words], of the map image.
        grid: where those lie in the map image.
        at: [rows · cols, 2] pixels of the map image, where the query's descriptors should be seen.
        reach: pixels, how far from there a thing may be: displacements go so far in x and in y, in whole cells.

    Yields:
        float32 [rows, cols] bits, and bool [rows, cols], whether the map image reaches there; the distance is 0 if not.
    """
    ours, theirs = (np.ascontiguousarray(signs) for signs in (query, image))
    col, row = np.rint(grid.places(at)).astype(np.int64).T.reshape(2, *query.shape[:2])
    across, down = (math.ceil(reach / step - _EXACT) for step in (grid.step_x, grid.step_y))
    compare = _compare if NATIVE else _compare_by_arrays
    for dy in range(-down, down + 1):
        for dx in range(-across, across + 1):
            distance, inside = np.zeros(query.shape[:2], np.float32), np.zeros(query.shape[:2], bool)
            compare(ours, theirs, row + dy, col + dx, distance, inside)
            yield distance, inside


def _compare_by_arrays(
    ours: Signs,
    theirs: Signs,
    y: NDArray[np.int64],
    x: NDArray[np.int64],
    distance: NDArray[np.float32],
    inside: NDArray[np.bool_],
) -> None:
    """Write how many bits differ from the descriptors at rows y and columns x, and whether they are there."""
    inside[...] = (y >= 0) & (y < theirs.shape[0]) & (x >= 0) & (x < theirs.shape[1])
    there = theirs[np.where(inside, y, 0), np.where(inside, x, 0)]
    for word in range(ours.shape[2]):  # a sum along so short an axis takes longer than all the rest
        distance += np.bitwise_count(ours[..., word] ^ there[..., word])
    distance *= inside


@njit
def _compare(ours, theirs, y, x, distance, inside):
    """Write the same, by compiled loops."""
    rows, cols, words = ours.shape
    for i in range(rows):
        for j in range(cols):
            k, m = y[i, j], x[i, j]
            if 0 <= k < theirs.shape[0] and 0 <= m < theirs.shape[1]:
                bits = np.uint64(0)
                for word in range(words):
                    bits += bits_set(ours[i, j, word] ^ theirs[k, m, word])
                distance[i, j], inside[i, j] = bits, True


def smallest(
    query: Signs, image: Signs, grid: Grid, at: NDArray[np.floating], reach: float, sigma: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the smallest distance over the displacements, alone and supported by the cells around.

    Args:
        query: as the others, that of ``displaced``.
        image: likewise.
        grid: likewise.
        at: likewise.
        reach: likewise.
        sigma: of the Gaussian of the support, cells; cells without a descriptor in the map image have no weight.

    Returns:
        float32 [rows, cols] bits each; NOWHERE where the map image does not reach.
    """
    alone = np.full(query.shape[:2], NOWHERE)
    supported = alone.copy()
    for distance, inside in displaced(query, image, grid, at, reach):
        np.minimum(alone, np.where(inside, distance, NOWHERE), out=alone)
        weight = _blurred(inside.astype(np.float32), sigma)  # at least the cell's own share where it is inside
        around = np.divide(_blurred(distance, sigma), weight, out=np.full_like(distance, NOWHERE), where=inside)
        np.minimum(supported, around, out=supported)
    return alone, supported


def _blurred(values: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    return np.asarray(cv2.GaussianBlur(values, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT), np.float32)
