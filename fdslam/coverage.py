"""Sums over the boxes that cover a pixel, and the maximum of pixels over cells.

Between box edges nothing changes, so sums are painted with difference arrays on the grid of the distinct edges instead
of on the pixels, and a cell looks at the blocks it touches instead of at its pixels.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fdslam.types import CELL, grid_shape


class Coverage:
    """Boxes on an image: the grid of their distinct edges. Between edges lie blocks of pixels that do not differ."""

    def __init__(self, boxes: NDArray[np.float32], height: int, width: int) -> None:
        """Lay the grid.

        Args:
            boxes: float32 [J, 4] xyxy pixels, half-open; what lies outside the image is cut off.
            height: of the image, pixels.
            width: of the image, pixels.
        """
        self.height, self.width = height, width
        self._y_edges, self._y0, self._y1 = _edges(boxes[:, 1], boxes[:, 3], height)
        self._x_edges, self._x0, self._x1 = _edges(boxes[:, 0], boxes[:, 2], width)

    def paint(self, values: NDArray[np.int64]) -> NDArray[np.int64]:
        """Sum values per box over the boxes that cover each block.

        Args:
            values: int64 [..., J].

        Returns:
            int64 [..., rows, columns] of blocks.
        """
        difference = np.zeros((len(self._y_edges), len(self._x_edges), *values.shape[:-1]), np.int64)
        moved = np.moveaxis(values, -1, 0)
        corners = ((self._y0, self._x0, 1), (self._y0, self._x1, -1), (self._y1, self._x0, -1), (self._y1, self._x1, 1))
        for y, x, sign in corners:
            np.add.at(difference, (y, x), sign * moved)
        return np.moveaxis(difference.cumsum(0).cumsum(1)[:-1, :-1], (0, 1), (-2, -1))

    def pixels(self, blocks: NDArray) -> NDArray:
        """Return the value of every pixel, [height, width], from that of every block, [rows, columns]."""
        return np.repeat(np.repeat(blocks, np.diff(self._y_edges), 0), np.diff(self._x_edges), 1)

    def cells(self, blocks: NDArray) -> NDArray:
        """Return the maximum of every cell of the image from the value of every block, [rows, columns]."""
        rows, columns = grid_shape(self.height, self.width)
        tall = _cell_maximum(blocks, self._y_edges, rows)
        return np.ascontiguousarray(_cell_maximum(tall.T, self._x_edges, columns).T)


def _edges(low: NDArray[np.float32], high: NDArray[np.float32], size: int) -> tuple[NDArray[np.int64], ...]:
    """Return the distinct pixel edges of half-open intervals, and each interval's first and end index among them."""
    # Pixel x belongs to a box when x0 <= x < x1: the first is ceil(x0), the first beyond is ceil(x1).
    first = np.clip(np.ceil(low), 0, size).astype(np.int64)
    end = np.maximum(np.clip(np.ceil(high), 0, size).astype(np.int64), first)
    edges = np.unique(np.concatenate([[0, size], first, end]))
    return edges, np.searchsorted(edges, first), np.searchsorted(edges, end)


def _cell_maximum(values: NDArray, edges: NDArray[np.int64], cells: int) -> NDArray:
    """Maximum of blocks (axis 0, between pixel edges) over each cell that they touch."""
    starts = np.arange(cells) * CELL
    fine = np.unique(np.concatenate([edges[:-1], starts]))
    spread = values[np.searchsorted(edges, fine, side="right") - 1]
    return np.maximum.reduceat(spread, np.searchsorted(fine, starts), axis=0)


def cell_maximum(pixels: NDArray) -> NDArray:
    """Return the maximum of the pixels [H, W] of every cell, [ceil(H / CELL), ceil(W / CELL)]."""
    rows = np.maximum.reduceat(pixels, np.arange(0, pixels.shape[0], CELL), axis=0)
    return np.maximum.reduceat(rows, np.arange(0, pixels.shape[1], CELL), axis=1)
