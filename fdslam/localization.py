"""Weak self-localisation by each OBB alone, strong self-localisation by all of them together (§FD)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fdslam.bow.islands import islands
from fdslam.bow.lists import ranks_of
from fdslam.bow.verification import verified
from fdslam.config import Retrieval
from fdslam.types import Boxes, Features, Localization

# Fixed-point 1.0 of 1 / rank: sums of reciprocals are integers, so the order of the OBBs cannot change them.
RECIPROCAL_ONE = 1 << 40


class Scores(Protocol):
    """A map, or its index alone."""

    def scores(self, words: NDArray[np.int32], inside: NDArray[np.bool_], score: str) -> NDArray[np.int64]:
        """Return s_j(m) of every OBB j of a query (bool [J, n]) and map image m, int64 [J, M]."""
        ...


def reciprocal(ranks: NDArray[np.int32]) -> NDArray[np.int64]:
    """Return 1 / rank in fixed point (RECIPROCAL_ONE = 1), int64, same shape."""
    return np.rint(RECIPROCAL_ONE / ranks).astype(np.int64)


def keypoints_inside(boxes: NDArray[np.float32], xy: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Tell which keypoint lies in which box.

    Args:
        boxes: float32 [J, 4] xyxy pixels, half-open.
        xy: float32 [n, 2] pixels.

    Returns:
        bool [J, n].
    """
    x, y = xy[:, 0], xy[:, 1]
    x0, y0, x1, y1 = boxes.T[:, :, None]
    return (x0 <= x) & (x < x1) & (y0 <= y) & (y < y1)


def strong_list(ranks: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the map ids by falling relevance Σ_j 1 / r_j(m); ties go to the smaller id.

    Args:
        ranks: int32 [J, M]; with J = 0 nothing is known and the list is 0 … M-1.

    Returns:
        int32 [M].
    """
    relevance = reciprocal(ranks).sum(axis=0)
    order = np.argsort(-relevance, kind="stable")
    # Each reciprocal is rounded by up to half a unit: sums within len(ranks) units may be equal or the other way.
    falling = relevance[order]
    ends = np.flatnonzero(np.append(falling[:-1] - falling[1:] > len(ranks), True)) + 1
    begins = np.concatenate([[0], ends[:-1]])
    # Most images of a large map are retrieved by no list and have the same ranks: there is nothing to compare.
    nowhere = (ranks == ranks.max(axis=1, initial=0)[:, None]).all(axis=0)
    for begin, end in zip(begins, ends, strict=True):
        if end - begin > 1 and falling[begin] > 0 and not nowhere[order[begin:end]].all():
            order[begin:end] = _exact_order(ranks, order[begin:end])
    return order.astype(np.int32)


def _exact_order(ranks: NDArray[np.int32], images: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the images by falling Σ_j 1 / r_j in exact fractions; ties by id. Equal multisets of ranks are one sum."""
    columns = np.sort(ranks[:, images], axis=0)
    distinct, which = np.unique(columns, axis=1, return_inverse=True)
    if distinct.shape[1] == 1:
        return np.sort(images)
    sums = [sum(Fraction(1, int(rank)) for rank in column) for column in distinct.T]
    places = {value: place for place, value in enumerate(sorted(set(sums), reverse=True))}
    place = np.array([places[value] for value in sums])[which.reshape(-1)]
    return images[np.lexsort((images, place))]


def localize(
    index: Scores,
    boxes: Boxes,
    query: Features,
    words: NDArray[np.int32],
    config: Retrieval,
    map_features: Callable[[int], Features],
) -> Localization:
    """Localise a query by every OBB (weak) and by all together (strong).

    OBBs that hold fewer than ``config.min_keypoints`` keypoints say nothing and are left out.

    Args:
        index: the map.
        boxes: the OBBs of the query.
        query: its n keypoints.
        words: int32 [n], their words.
        config: score, islands, verification, rank of images not retrieved, least number of keypoints.
        map_features: from a map id to the features of that image; asked for only with ``config.verify_top``.
    """
    inside = keypoints_inside(boxes.xyxy, query.xy)
    speaks = inside.sum(axis=1) >= config.min_keypoints
    inside = inside[speaks]
    levels = islands(index.scores(words, inside, config.score), config.islands)
    levels = verified(levels, query, inside, map_features, config.verify_top, config.verify_inliers)
    ranks = ranks_of(levels, config.unretrieved)
    source = tuple(name for name, kept in zip(boxes.source, speaks, strict=True) if kept)
    return Localization(replace(boxes, xyxy=boxes.xyxy[speaks], source=source), ranks, strong_list(ranks), boxes)
