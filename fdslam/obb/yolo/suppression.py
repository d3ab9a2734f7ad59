"""Non-maximum suppression within each class, in one image and over its tiles."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.obb.yolo.heads import Candidates

Tile = tuple[int, int, int, int]  # xyxy pixels of the image
_AT_THE_EDGE = 0.02  # of a tile's side: a box that ends there may go on in the next tile
_COVERED = 0.5  # share of such a box that a larger one of the next tile must cover to stand for it


def suppressed(found: Candidates, overlap: float) -> Candidates:
    """Keep, best first, the boxes that no better one of their class overlaps by more than ``overlap`` (IoU).

    Of equal scores the earlier candidate is the better one.
    """
    corner, size = found.xyxy[:, :2], found.xyxy[:, 2:] - found.xyxy[:, :2]
    boxes = np.concatenate([corner, size], axis=1)
    order = cv2.dnn.NMSBoxesBatched(boxes.tolist(), found.score.tolist(), found.label.tolist(), 0.0, overlap)
    return taken(found, np.array(order, np.int64).reshape(-1))


def taken(found: Candidates, which: NDArray) -> Candidates:
    """Return some of the candidates, by number or by truth values."""
    return Candidates(found.xyxy[which], found.score[which], found.label[which])


def merged(parts: Sequence[Candidates], tiles: Sequence[Tile], height: int, width: int, overlap: float) -> Candidates:
    """Return the boxes of overlapping tiles as those of one image.

    An object that a tile's inner edge cuts is found there in part, and whole in the next tile: the part is left out.
    What no tile holds whole stays in parts.

    Args:
        parts: per tile its boxes in pixels of the image, already suppressed.
        tiles: where each lies.
        height: of the image, pixels.
        width: of the image, pixels.
        overlap: as of ``suppressed``.
    """
    if len(parts) == 1:
        return parts[0]
    whole = Candidates(
        np.concatenate([p.xyxy for p in parts]),
        np.concatenate([p.score for p in parts]),
        np.concatenate([p.label for p in parts]),
    )
    number = np.repeat(np.arange(len(parts)), [len(p.score) for p in parts])
    cut = np.concatenate([_cut(p.xyxy, tile, height, width) for p, tile in zip(parts, tiles, strict=True)])
    area = (whole.xyxy[:, 2] - whole.xyxy[:, 0]) * (whole.xyxy[:, 3] - whole.xyxy[:, 1])
    other = (number[:, None] != number) & (whole.label[:, None] == whole.label) & (area > area[:, None])
    covered = (_intersection(whole.xyxy) > _COVERED * area[:, None]) & other
    return suppressed(taken(whole, ~(cut & covered.any(axis=1))), overlap)


def _cut(xyxy: NDArray[np.float64], tile: Tile, height: int, width: int) -> NDArray[np.bool_]:
    """Tell which boxes end at an edge of their tile that is none of the image."""
    x0, y0, x1, y1 = tile
    near_x, near_y = _AT_THE_EDGE * (x1 - x0), _AT_THE_EDGE * (y1 - y0)
    left, right = (xyxy[:, 0] < x0 + near_x) & (x0 > 0), (xyxy[:, 2] > x1 - near_x) & (x1 < width)
    top, bottom = (xyxy[:, 1] < y0 + near_y) & (y0 > 0), (xyxy[:, 3] > y1 - near_y) & (y1 < height)
    return np.asarray(left | right | top | bottom)


def _intersection(xyxy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the common area of every two boxes, [n, n]."""
    low = np.maximum(xyxy[:, None, :2], xyxy[:, :2])
    high = np.minimum(xyxy[:, None, 2:], xyxy[:, 2:])
    return np.asarray(np.clip(high - low, 0, None).prod(axis=2))
