"""Candidate boxes of change: where the likeliest cells lie together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fdslam.fusion import percentiles
from fdslam.metrics.accuracy import EIGHT
from fdslam.types import CELL


@dataclass(frozen=True)
class Candidate:
    """A part of an image that may have changed."""

    xyxy: NDArray[np.float32]  # [4] pixels, half-open
    score: float  # how many cells it has, each weighed by how high it stands: 0 just high enough, 1 highest of the pool


def candidates(
    places: NDArray[np.float32], height: int, width: int, share: float = 5.0, top: int = 10
) -> tuple[Candidate, ...]:
    """Return the boxes around the 8-connected groups of the cells that stand highest, best first.

    Args:
        places: float32 [rows, columns], each cell's place in its pool, 0 … 1, as ``fusion.percentiles`` gives it. Where
            the pool is many images an unchanged one may have no candidate; where it is one image there is always one.
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
        score = float(((places[rows, columns][inside] - least) / (1 - least)).sum(dtype=np.float64))
        right, bottom = min(columns.stop * CELL, width), min(rows.stop * CELL, height)
        xyxy = np.array([columns.start * CELL, rows.start * CELL, right, bottom], np.float32)
        found.append(Candidate(xyxy, score))
    return tuple(sorted(found, key=lambda one: (-one.score, *one.xyxy.tolist()))[:top])


def candidates_of(
    maps: Sequence[NDArray[np.floating]], sizes: Sequence[tuple[int, int]], share: float = 5.0, top: int = 10
) -> list[tuple[Candidate, ...]]:
    """Return the candidates of every image of a pool, from the LoC of their cells and their sizes (height, width)."""
    places = percentiles(maps)
    return [candidates(one, *size, share=share, top=top) for one, size in zip(places, sizes, strict=True)]
