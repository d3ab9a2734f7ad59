"""Figures: IoU of label images, average precision and recall of boxes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


def confusion(true: NDArray[np.uint8], said: NDArray[np.uint8], classes: int) -> NDArray[np.int64]:
    """Return how many pixels [true, said] of each label were given each label."""
    pairs = true.ravel().astype(np.int64) * classes + said.ravel()
    return np.bincount(pairs, minlength=classes * classes).reshape(classes, classes)


def iou(table: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the IoU [classes] of a confusion matrix; NaN of a label that is neither there nor said."""
    both = np.diag(table)
    either = table.sum(0) + table.sum(1) - both
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(either > 0, both / either, np.nan)


def merged_iou(table: NDArray[np.int64], merged: Sequence[int]) -> float:
    """Return the IoU of the union of some labels."""
    mine = np.isin(np.arange(len(table)), merged)
    both = table[np.ix_(mine, mine)].sum()
    either = table[mine].sum() + table[:, mine].sum() - both
    return float(both / either) if either else float("nan")


def box_iou(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the IoU [n, m] of boxes [n, 4] and [m, 4], xyxy."""
    low, high = np.maximum(a[:, None, :2], b[None, :, :2]), np.minimum(a[:, None, 2:], b[None, :, 2:])
    both = (high - low).clip(0).prod(2)
    areas = ((x[:, 2:] - x[:, :2]).prod(1) for x in (a, b))
    either = np.add.outer(*areas) - both
    return np.asarray(both / np.maximum(either, 1e-9), np.float32)


@dataclass(frozen=True)
class Found:
    """Detections of one image against what is there."""

    scores: NDArray[np.float32]  # [k], falling
    hit: NDArray[np.bool_]  # [k] found an object that nothing of a higher score found
    counts: NDArray[np.bool_]  # [k] False: on an object that is not asked for, so neither right nor wrong
    asked: int  # objects


def match(
    boxes: NDArray[np.float32], scores: NDArray[np.float32], true: NDArray[np.float32], clear: NDArray[np.bool_],
    least: float = 0.5,
) -> Found:  # fmt: skip
    """Match detections to objects, the best score first, each to the object of the largest IoU that is still free.

    Args:
        boxes: [k, 4] detections.
        scores: [k].
        true: [n, 4] objects.
        clear: [n] an object that is not clear is not asked for.
        least: IoU of a match.
    """
    order = np.argsort(-scores, kind="stable")
    overlap = box_iou(boxes[order], true)
    free, hit, counts = clear.copy(), np.zeros(len(order), bool), np.ones(len(order), bool)
    for k, row in enumerate(overlap):
        best = int(np.argmax(np.where(free, row, -1))) if len(row) else -1
        if best >= 0 and free[best] and row[best] >= least:
            free[best], hit[k] = False, True
        elif len(row) and bool((row[~clear] >= 0.3).any()):
            counts[k] = False
    return Found(scores[order], hit, counts, int(clear.sum()))


def average_precision(found: Sequence[Found]) -> float:
    """Return the area under the curve of precision against recall, precision made monotone; NaN without objects."""
    asked = sum(f.asked for f in found)
    if not asked:
        return float("nan")
    scores = np.concatenate([f.scores[f.counts] for f in found])
    hit = np.concatenate([f.hit[f.counts] for f in found])[np.argsort(-scores, kind="stable")]
    right = np.cumsum(hit)
    precision = right / np.arange(1, len(hit) + 1)
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    return float((envelope * hit).sum() / asked)


def recall(found: Sequence[Found], most: int) -> float:
    """Return the share of the objects among the ``most`` best detections of their images; NaN without objects."""
    asked = sum(f.asked for f in found)
    return sum(int(f.hit[:most].sum()) for f in found) / asked if asked else float("nan")
