"""Keypoints without a partner: those of a query that the map has no word for, and words of the map that are missing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fdslam.bow.around import NONE, nearest_around
from fdslam.compact.alignment import Aligned
from fdslam.types import Features


def new_keypoints(query: Features, images: Sequence[Aligned], radius: float) -> NDArray[np.int64]:
    """Return how far the nearest word of the aligned images is from each keypoint of a query, int64 [n] bits.

    The smallest over the images; NONE where there is none around.
    """
    best = np.full(len(query.xy), NONE)
    for one in images:
        np.minimum(best, nearest_around(query.descriptors, one.to_map.at(query.xy), one.other, radius), out=best)
    return best


def missing_words(
    query: Features, one: Aligned, size: tuple[int, int], radius: float
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Return where words of a map image should be seen in a query, and how far the query's nearest keypoint is.

    Args:
        query: its keypoints.
        one: the map image.
        size: height and width of the query, pixels; words that should be seen outside are left out.
        radius: pixels.

    Returns:
        float32 [n, 2] pixels of the query, and int64 [n] bits; NONE where no keypoint is around.
    """
    at = one.to_query.at(one.other.xy)
    inside = ((at >= 0) & (at < (size[1], size[0]))).all(axis=1)
    place = at[inside]
    clipped = np.minimum(
        place.astype(np.float32), np.nextafter(np.array([size[1], size[0]], np.float32), np.float32(0))
    )
    return clipped, nearest_around(one.other.descriptors[inside], place, query, radius)
