"""Everything that a query's detectors say with the compact map, on the query's cells."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.compact.alignment import Aligned
from fdslam.compact.comparison import NOWHERE, smallest
from fdslam.compact.grid import Grid
from fdslam.compact.partners import missing_words, new_keypoints
from fdslam.compact.signs import Signs
from fdslam.config import Compact, Comparison
from fdslam.detectors.comparison import keypoints_to_cells
from fdslam.store import Arrays
from fdslam.types import CELL, Cells, Features, grid_shape

SIGMA = 1.5  # cells; of the Gaussian around keypoints
PRIOR = 0.4  # keypoints a cell: where there are fewer around, they count for less
LEVELS = ("fine", "coarse")


@dataclass(frozen=True)
class Looks:
    """The dense binary descriptors of an image."""

    signs: tuple[Signs, Signs]  # fine and coarse
    grids: tuple[Grid, Grid]  # where they lie
    bits: tuple[int, int]  # of a descriptor


def evidence(
    query: Features,
    looks: Looks,
    size: tuple[int, int],
    images: Sequence[Aligned],
    map_looks: Callable[[int], Looks],
    config: Compact,
) -> Arrays:
    """Return what the compact map says of a query's cells.

    Args:
        query: its keypoints.
        looks: its dense descriptors.
        size: its height and width, pixels.
        images: the map images it is aligned with, best first; none: nothing is known.
        map_looks: from a map id to its dense descriptors.
        config: ``reach``, ``word_reach``, ``word_distance``, and the support of either stride.

    Returns:
        Cells, float32 [rows, cols]: ``fine`` and ``coarse``, the smallest share of bits that differ, 0 … 1, over the
        images and supported by the cells around, and the mean share where no image reaches; ``fine alone`` and
        ``coarse alone``, likewise of each descriptor by itself; ``words``, the share of the
        keypoints around without a partner; ``missing``, the share of the words around that should be seen and are not;
        ``texture``, the density of keypoints; ``near`` and ``wide``, how many agreeing keypoints are around. And
        ``inliers``, float32 [images]: how many agree with each image.
    """
    side = math.sqrt(size[0] * size[1])
    radius, around = config.reach / 100 * side, config.word_reach / 100 * side
    found: Arrays = {}
    for level, name in enumerate(LEVELS):
        sigma = (config.fine_support, config.coarse_support)[level]
        alone, supported = _compared(looks, level, images, map_looks, radius, sigma)
        found[name] = looks.grids[level].to_cells(supported, *size)
        found[f"{name} alone"] = looks.grids[level].to_cells(alone, *size)
    spread = Comparison(spread="normalised", spread_sigma=SIGMA, spread_prior=PRIOR)
    without = new_keypoints(query, images, around) > config.word_distance
    found["words"] = keypoints_to_cells(query.xy, without.astype(np.float32), *size, spread)
    found["missing"] = np.zeros(grid_shape(*size), np.float32)
    for one in images:
        place, distance = missing_words(query, one, size, around)
        lost = (distance > config.word_distance).astype(np.float32)
        found["missing"] += keypoints_to_cells(place, lost, *size, spread) / len(images)
    found["texture"] = _density(query.xy, size)
    found["near"], found["wide"] = _confidence(images, size)
    found["inliers"] = np.array([len(one.here) for one in images], np.float32)
    return found


def _compared(
    looks: Looks, level: int, images: Sequence[Aligned], map_looks: Callable[[int], Looks], radius: float, sigma: float
) -> list[NDArray[np.float32]]:
    """Return the smallest share of the bits that differ, alone and supported, on the grid of a level.

    Where no image reaches it is the mean of elsewhere.
    """
    signs, grid = looks.signs[level], looks.grids[level]
    best: list[NDArray[np.float32]] = [np.full(signs.shape[:2], NOWHERE)] * 2
    centres = grid.centres()
    for one in images:
        other = map_looks(one.image)
        at = one.to_map.at(centres)
        found = smallest(signs, other.signs[level], other.grids[level], at, radius, sigma)
        best = [np.minimum(*pair) for pair in zip(best, found, strict=True)]
    known = best[0] < NOWHERE
    if not known.any():
        return [np.zeros_like(values) for values in best]
    filled = (np.where(known, values, values[known].mean()) / looks.bits[level] for values in best)
    return [values.astype(np.float32) for values in filled]


def _density(xy: NDArray[np.float32], size: tuple[int, int]) -> Cells:
    """Return how many keypoints a cell has around, weighted by a Gaussian."""
    plain = Comparison(spread="normalised", spread_sigma=SIGMA, spread_prior=1.0)
    share = keypoints_to_cells(xy, np.ones(len(xy), np.float32), *size, plain).astype(np.float64)
    return (share / np.maximum(1 - share, 1e-6)).astype(np.float32)  # n / (n + 1) back to n


def _confidence(images: Sequence[Aligned], size: tuple[int, int]) -> tuple[Cells, Cells]:
    """Return how many agreeing keypoints are around each cell in the best of the images, near and wide."""
    rows, cols = grid_shape(*size)
    centres = Grid(rows, cols, CELL, CELL).centres()
    each = [one.to_map.confidence(centres) for one in images]
    best = np.max(each, axis=0) if each else np.zeros((rows * cols, 2), np.float32)
    return best[:, 0].reshape(rows, cols), best[:, 1].reshape(rows, cols)
