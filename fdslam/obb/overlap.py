"""How much boxes overlap."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NEVER = np.iinfo(np.int64).max  # boxes until an object is found that none finds


def iou(boxes: NDArray, others: NDArray) -> NDArray[np.float64]:
    """Return intersection over union of every pair of boxes, float64 [n, m]; 0 where a union is empty.

    Args:
        boxes: [n, 4] xyxy, half-open.
        others: [m, 4] xyxy, half-open.
    """
    a, b = boxes.astype(np.float64).reshape(-1, 1, 4), others.astype(np.float64).reshape(1, -1, 4)
    shared = np.prod(np.maximum(np.minimum(a[..., 2:], b[..., 2:]) - np.maximum(a[..., :2], b[..., :2]), 0), axis=2)
    union = np.prod(a[..., 2:] - a[..., :2], axis=2) + np.prod(b[..., 2:] - b[..., :2], axis=2) - shared
    return np.divide(shared, union, out=np.zeros_like(shared), where=union > 0)


def first_found(boxes: NDArray, objects: NDArray, least: float) -> NDArray[np.int64]:
    """Return for each object how many boxes, best first, it takes until one has IoU >= ``least``: int64 [m].

    Args:
        boxes: [n, 4] xyxy, best first.
        objects: [m, 4] xyxy.
        least: 0 < least <= 1.

    Returns:
        1 … n, or NEVER where no box finds the object.
    """
    hit = iou(boxes, objects) >= least
    return np.where(hit.any(0), np.argmax(hit, axis=0) + 1 if len(boxes) else 0, NEVER).astype(np.int64)
