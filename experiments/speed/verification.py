"""Geometric verification of 64 OBBs in 10 candidates: all OBBs at once, and one by one."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from experiments.speed.stages import OBBS, cpu_seconds, random_boxes
from fdslam.bow import verification
from fdslam.bow.lists import first_images
from fdslam.bow.verification import agreeing, inliers_per_obb
from fdslam.localization import keypoints_inside
from fdslam.types import Features

CANDIDATES, LEAST = 10, 20


@dataclass
class Verification:
    """CPU seconds of one query."""

    together: float  # the same ten candidates for all OBBs, all at once
    one_by_one: float  # every (OBB, candidate) matched and fitted for itself, by the same matcher
    opencv: float  # the same by OpenCV's brute-force matcher
    own: float  # every list's own first ten, all at once
    own_one_by_one: float  # the same, every pair for itself
    own_opencv: float  # the same by OpenCV's brute-force matcher
    distinct: float  # different images among those 64 × 10
    inliers: float  # per (OBB, candidate) of the ten, the mean


def _by_opencv(descriptors: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Do what hamming.two_nearest does by OpenCV; distances and indices, int32 [n, 2]."""
    pairs = cv2.BFMatcher(cv2.NORM_HAMMING).knnMatch(descriptors, others, 2)
    found = [[(m.distance, m.trainIdx) for m in pair] for pair in pairs]
    both = np.array(found).astype(np.int32)
    return both[:, :, 0], both[:, :, 1]


def _one_by_one(query: Features, inside: np.ndarray, lists: list[list[Features]]) -> np.ndarray:
    """Return the inliers of every OBB in each of its candidates, int64 [J, C]: nothing is shared."""
    return np.array(
        [
            [np.count_nonzero(agreeing(query, other, LEAST) & box) for other in others]
            for box, others in zip(inside, lists, strict=True)
        ]
    )


def _own(query: Features, inside: np.ndarray, best: np.ndarray, images: list[Features]) -> np.ndarray:
    """Return the inliers of every OBB in its own candidates (int [J, C] map ids), each image matched once."""
    distinct, place = np.unique(best, return_inverse=True)
    counts = inliers_per_obb(query, inside, [images[m] for m in distinct], LEAST)
    return np.take_along_axis(counts, place.reshape(best.shape), axis=1)


def measure(query: Features, scores: np.ndarray, images: list[Features]) -> Verification:
    """Measure one query.

    Args:
        query: its keypoints.
        scores: int64 [1 + OBBS, M], of the full image, then of every box of ``random_boxes``.
        images: the M map images.

    Raises:
        RuntimeError: the ways do not count the same inliers.
    """
    inside = keypoints_inside(random_boxes(np.random.default_rng(0)), query.xy)
    ten = [images[m] for m in first_images(scores[:1], CANDIDATES)[0]]
    best = first_images(scores[1:], CANDIDATES)
    lists = [[images[m] for m in row] for row in best]
    counts = inliers_per_obb(query, inside, ten, LEAST)
    together = cpu_seconds(lambda: inliers_per_obb(query, inside, ten, LEAST))
    own = cpu_seconds(lambda: _own(query, inside, best, images))
    same = [np.array_equal(_own(query, inside, best, images), _one_by_one(query, inside, lists))]
    same.append(np.array_equal(counts, _one_by_one(query, inside, [ten] * OBBS)))
    one_by_one = cpu_seconds(lambda: _one_by_one(query, inside, [ten] * OBBS), repeat=1)
    own_one_by_one = cpu_seconds(lambda: _one_by_one(query, inside, lists), repeat=1)
    native, verification.two_nearest = verification.two_nearest, _by_opencv
    try:
        same.append(np.array_equal(counts, _one_by_one(query, inside, [ten] * OBBS)))
        opencv = cpu_seconds(lambda: _one_by_one(query, inside[:4], [ten] * 4), repeat=1) * OBBS / 4
        own_opencv = cpu_seconds(lambda: _one_by_one(query, inside[:4], lists[:4]), repeat=1) * OBBS / 4
    finally:
        verification.two_nearest = native
    if not all(same):
        raise RuntimeError("verification at once and one by one disagree")
    times = (together, one_by_one, opencv, own, own_one_by_one, own_opencv)
    return Verification(*times, len(np.unique(best)), float(counts.mean()))


def mean(measured: list[Verification]) -> Verification:
    """Return the mean over queries of every figure."""
    names = Verification.__dataclass_fields__
    return Verification(**{name: float(np.mean([getattr(one, name) for one in measured])) for name in names})


def table(unit: float, v: Verification) -> str:
    """Return the figures as Markdown."""
    same = f"the same {CANDIDATES} for all", v.together
    own = f"every list's own {CANDIDATES}, {v.distinct:.0f} images", v.own
    rows = [
        (*same, "one by one", v.one_by_one),
        (*same, "one by one, OpenCV's matcher", v.opencv),
        (*own, "one by one", v.own_one_by_one),
        (*own, "one by one, OpenCV's matcher", v.own_opencv),
    ]
    lines = [f"| {OBBS} OBBs verified in | at once | baseline | it takes | times faster |", "|---|---:|---|---:|---:|"]
    lines += [f"| {a} | {t / unit:.2f} U | {b} | {s / unit:.0f} U | {s / t:.1f} |" for a, t, b, s in rows]
    return "\n".join(lines)
