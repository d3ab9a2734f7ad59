"""Candidate boxes of change: where the likeliest cells lie together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fdslam.metrics.accuracy import EIGHT
from fdslam.types import CELL

FEWEST = 4  # cells: fewer are a speck of 10 × 20 pixels at most


@dataclass(frozen=True, eq=False)  # arrays are neither equal nor unequal
class Candidate:
    """A part of an image that may have changed."""

    xyxy: NDArray[np.float32]  # [4] pixels, half-open
    score: float  # how many cells it has, each weighed by how high it stands: 0 just high enough, 1 highest of the pool


def candidates(
    places: NDArray[np.float32], height: int, width: int, share: float = 5.0, top: int = 10
) -> tuple[Candidate, ...]:
    """Return the boxes around the 8-connected groups of the cells that stand highest, best first.

    Groups of under 4 cells are left out, and boxes inside that of a better one.

    Args:
        places: float32 [rows, columns], each cell's place in its pool, 0 … 1, as ``fusion.percentiles`` gives it. Where
            the pool is many images an unchanged one may have no candidate; where it is one image some cells always
            stand highest, changed or not.
        height: of the image, pixels.
        width: of the image, pixels.
        share: percent of the pool's cells that count as high (the paper's X).
        top: the most candidates.

    Returns:
        Candidates by falling score.
    """
    least = 1 - share / 100
    labels, _ = ndimage.label(places > least, structure=EIGHT)
    found = []
    for number, (rows, columns) in enumerate(ndimage.find_objects(labels), 1):
        inside = labels[rows, columns] == number
        if np.count_nonzero(inside) < FEWEST:
            continue
        score = float(((places[rows, columns][inside] - least) / (1 - least)).sum(dtype=np.float64))
        right, bottom = min(columns.stop * CELL, width), min(rows.stop * CELL, height)
        xyxy = np.array([columns.start * CELL, rows.start * CELL, right, bottom], np.float32)
        found.append(Candidate(xyxy, score))
    best: list[Candidate] = []
    for one in sorted(found, key=lambda one: (-one.score, *one.xyxy.tolist())):
        if len(best) < top and not any(_within(one, other) for other in best):
            best.append(one)
    return tuple(best)


def _within(one: Candidate, other: Candidate) -> bool:
    return bool((one.xyxy[:2] >= other.xyxy[:2]).all() and (one.xyxy[2:] <= other.xyxy[2:]).all())
