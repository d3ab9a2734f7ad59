"""Geometric verification: a map image is where the robot is if the query's keypoints fit it as one rigid scene (§FD).

The two images are matched once and one model is fitted for all OBBs together: a fundamental matrix by USAC, or a
homography where that finds no support (a planar view). How many of the agreeing keypoints lie in each OBB is then a
product of two matrices, so that 64 OBBs cost what one does. In the list of an OBB the verified ones of its first images
go first, by those numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.bow.hamming import two_nearest
from fdslam.bow.lists import first_images
from fdslam.types import Features

RATIO = 0.8  # of the nearest and the second nearest descriptor
PIXELS, CONFIDENCE = 2.0, 0.985  # a keypoint agrees if it is no farther from the model
RECENT = 64  # pairs of images whose matches are kept at hand; a query is matched with up to 15 map images
Matches = tuple[NDArray[np.int64], NDArray[np.int64]]  # indices of keypoints of either image, the first rising
_MODELS = ((cv2.findFundamentalMat, 7), (cv2.findHomography, 4))  # and the fewest matches they take


def correspondences(query: Features, other: Features) -> Matches:
    """Match two images by the ratio test, one to one: indices of their keypoints, int64 [k] each, the first rising.

    Of several keypoints of the query that want the same one of the other image the nearest has it, then the first.
    """
    return _matched(query.descriptors, other.descriptors)


def _matched(ours: NDArray[np.uint8], theirs: NDArray[np.uint8]) -> Matches:
    distance, index = two_nearest(ours, theirs)
    mine = np.flatnonzero((index[:, 1] >= 0) & (distance[:, 0] <= RATIO * distance[:, 1]))
    order = mine[np.lexsort((mine, distance[mine, 0]))]
    _, first = np.unique(index[order, 0], return_index=True)
    mine = np.sort(order[first])
    return mine, index[mine, 0].astype(np.int64)


@lru_cache(RECENT)
def _at_hand(ours: bytes, theirs: bytes) -> Matches:
    """Return the matches of descriptors by their bytes: hashing them takes a hundredth of the time of matching them.

    Word support and the compact map's alignment ask for the same pairs, with places that differ in rounding.
    """
    found = _matched(*(np.frombuffer(rows, np.uint8).reshape(-1, 32) for rows in (ours, theirs)))
    for indices in found:
        indices.setflags(write=False)  # whoever asks next gets the same arrays
    return found


def _recent(query: Features, other: Features) -> Matches:
    return _at_hand(query.descriptors.tobytes(), other.descriptors.tobytes())


def _usac() -> cv2.UsacParams:
    """Return the parameters of RANSAC: a fixed state and one thread, so that a result is always the same."""
    parameters = cv2.UsacParams()
    parameters.threshold, parameters.confidence = PIXELS, CONFIDENCE
    parameters.isParallel, parameters.randomGeneratorState = False, 0
    return parameters


def supporting_matches(query: Features, other: Features, least: int) -> Matches:
    """Return the matches of two images that fit one rigid scene; none, if fewer than ``least`` do.

    Of the last ``RECENT`` pairs the matches are at hand, and are not made again.

    Returns:
        Indices of the keypoints of either image, int64 [k] each, the first rising.
    """
    return _fitting(query, other, _recent(query, other), least)


@dataclass(frozen=True)
class Supported:
    """A map image and its matches with a query that fit one rigid scene."""

    image: int  # map id
    other: Features  # what is known of it
    mine: NDArray[np.int64]  # [k] keypoints of the query, rising
    theirs: NDArray[np.int64]  # [k] their partners


def best_supported(
    query: Features, images: Iterable[int], words: Callable[[int], Features], least: int, count: int
) -> list[Supported]:
    """Return the images with most ``supporting_matches``, those with most first, then the smaller id.

    A model supports no more than the matches it is fitted to. Images are fitted in the order of their matches, and no
    more are when as many as wanted have more support than another has matches: most time goes into those that fit ill.

    Args:
        query: its keypoints.
        images: map ids, distinct.
        words: from a map id to the keypoints of that image.
        least: that of ``supporting_matches``; images without support come last.
        count: how many are returned, if there are so many.
    """
    matched = []
    for m in images:
        other = words(m)
        matches = _recent(query, other)
        matched.append((-len(matches[0]), m, other, matches))
    found: list[Supported] = []
    for negative, m, other, matches in sorted(matched, key=lambda one: one[:2]):
        if len(found) == count and len(found[-1].mine) > -negative:
            break
        found.append(Supported(m, other, *_fitting(query, other, matches, least)))
        found = sorted(found, key=lambda one: (-len(one.mine), one.image))[:count]
    return found


def _fitting(query: Features, other: Features, matches: Matches, least: int) -> Matches:
    mine, theirs = matches
    for find, needed in _MODELS:
        if len(mine) < max(least, needed):
            continue
        mask = _supporters(find, query.xy[mine], other.xy[theirs])
        if np.count_nonzero(mask) >= least:
            return mine[mask], theirs[mask]
    return mine[:0], theirs[:0]


def agreeing(query: Features, other: Features, least: int) -> NDArray[np.bool_]:
    """Tell which keypoints of the query agree with the other image, bool [n]; none, if fewer than ``least`` do."""
    result = np.zeros(len(query.xy), bool)
    result[_fitting(query, other, correspondences(query, other), least)[0]] = True
    return result


def _supporters(find: Callable[..., tuple], here: NDArray[np.float32], there: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return which of the matches (float32 [k, 2] pixels each) the best model supports, bool [k]; none without one."""
    try:
        model, mask = find(here, there, _usac())
    except cv2.error as error:  # OpenCV 5.0 trips over a sample without a model, once in some 20,000 pairs
        if "model.empty()" not in str(error):
            raise
        model = None
    return np.zeros(len(here), bool) if model is None else np.asarray(mask, bool).reshape(-1)


def inliers_per_obb(
    query: Features, inside: NDArray[np.bool_], others: Iterable[Features], least: int
) -> NDArray[np.int64]:
    """Return how many keypoints in each OBB of the query agree with each of the other images.

    Args:
        query: n keypoints.
        inside: bool [J, n], which OBB holds which keypoint.
        others: the C images, each matched and fitted once.
        least: agreeing keypoints of the whole query that make an image a verified one; others count 0.

    Returns:
        int64 [J, C].
    """
    agree = [agreeing(query, other, least) for other in others]
    # Floating point is exact here, and its product the fast one.
    counts = inside.astype(np.float32) @ np.array(agree, np.float32).reshape(len(agree), len(query.xy)).T
    return counts.astype(np.int64)


def promote(
    levels: NDArray[np.int64], first: NDArray[np.bool_], candidates: NDArray[np.int64], inliers: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Put verified images first, by inliers, then by their level; the others follow in the order they had.

    Args:
        levels: int64 [J, M], larger is better, 0 is never retrieved.
        first: bool [J, C], whether a candidate is among those of the list that are verified.
        candidates: int64 [C] map ids.
        inliers: int64 [J, C].

    Returns:
        Levels of the new order, int64 [J, M].
    """
    result = levels.copy()
    for row, among, counts in zip(result, first, inliers, strict=True):
        chosen = np.flatnonzero(among & (counts > 0))
        images = candidates[chosen]
        _, grade = np.unique(np.stack([counts[chosen], row[images]], axis=1), axis=0, return_inverse=True)
        row[images] = row.max(initial=0) + 1 + grade.reshape(-1)
    return result


def verified(
    levels: NDArray[np.int64],
    query: Features,
    inside: NDArray[np.bool_],
    map_features: Callable[[int], Features],
    top: int,
    least: int,
) -> NDArray[np.int64]:
    """Verify the first ``top`` images of every list, each image once, and put those that pass first.

    Args:
        levels: int64 [J, M], larger is better, 0 is never retrieved.
        query: n keypoints.
        inside: bool [J, n], which OBB holds which keypoint.
        map_features: from a map id to the features of that image.
        top: images of each list; with 0 nothing changes.
        least: that of ``inliers_per_obb``.

    Returns:
        Levels of the new order, int64 [J, M].
    """
    if not top or not levels.size:
        return levels
    best = first_images(levels, top).astype(np.int64)
    best[np.take_along_axis(levels, best, axis=1) == 0] = -1
    candidates = np.unique(best[best >= 0])
    inliers = inliers_per_obb(query, inside, (map_features(int(m)) for m in candidates), least)
    first = (best[:, None, :] == candidates[None, :, None]).any(axis=2)
    return promote(levels, first, candidates, inliers)
