"""Areas of cells, boxes and what they share (§Performance)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fdslam.types import CELL, grid_shape

ROUNDING = 1e-9  # relative: far above the error of summing thousands of areas, far below any share that is meant


def at_least(part: ArrayLike, whole: ArrayLike, share: float) -> NDArray[np.bool_]:
    """Tell where ``part`` is at least ``share`` of ``whole``; exactly that share counts.

    Areas are sums of float products, so "exactly half" may come out one rounding error short: the bound is lowered by
    the factor 1 - ``ROUNDING``.
    """
    return np.asarray(part) >= share * (1 - ROUNDING) * np.asarray(whole)


def _edges(length: int) -> NDArray[np.float64]:
    """Return the borders of the cells along one side of ``length`` pixels, the last cell cut at the image: [n + 1]."""
    return np.minimum(np.arange(grid_shape(length, length)[0] + 1) * CELL, length).astype(np.float64)


def _shared(low: float, high: float, length: int) -> NDArray[np.float64]:
    """Return how much of the interval [low, high) lies in every cell along one side: [n] pixels."""
    edges = _edges(length)
    return np.maximum(np.minimum(edges[1:], high) - np.maximum(edges[:-1], low), 0.0)


def cell_areas(height: int, width: int) -> NDArray[np.float64]:
    """Return the area of every cell, those at the right and lower border cut at the image: [rows, cols] pixels."""
    return np.outer(np.diff(_edges(height)), np.diff(_edges(width)))


def box_overlap(box: ArrayLike, height: int, width: int) -> NDArray[np.float64]:
    """Return the area that a box shares with every cell.

    Args:
        box: [4] xyxy, pixels, half-open, any real numbers; what lies outside the image is cut off.
        height: of the image, pixels.
        width: of the image, pixels.

    Returns:
        [rows, cols] float64, square pixels. Its sum is the area of the box inside the image.
    """
    x0, y0, x1, y1 = np.asarray(box, dtype=np.float64)
    return np.outer(_shared(y0, y1, height), _shared(x0, x1, width))


def positive_cells(boxes: ArrayLike, height: int, width: int) -> NDArray[np.bool_]:
    """Tell which cells are changed according to the boxes.

    A cell is positive if at least half of its area (inside the image) lies in some one box. A box that gets no cell
    this way takes the cell that contains the centre of its part inside the image. A box outside the image takes none.

    Args:
        boxes: [n, 4] xyxy, pixels, half-open.
        height: of the image, pixels.
        width: of the image, pixels.

    Returns:
        [rows, cols] bool.
    """
    areas = cell_areas(height, width)
    positive = np.zeros(areas.shape, dtype=bool)
    for box in np.asarray(boxes, dtype=np.float64).reshape(-1, 4):
        overlap = box_overlap(box, height, width)
        mine = at_least(overlap, areas, 0.5)
        if not mine.any() and overlap.any():
            x, y = (np.clip(box[:2], 0, (width, height)) + np.clip(box[2:], 0, (width, height))) / 2
            mine[int(y // CELL), int(x // CELL)] = True
        positive |= mine
    return positive
