"""Where the cells of a network's features lie in the image that it looked at.

Coordinates are pixels of the image, corner convention: the centre of cell (row, column) of a grid of stride s over the
image scaled by (fx, fy) is at ((column + ½) s / fx, (row + ½) s / fy).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.types import CELL, Cells, grid_shape

LINE = 1024  # points read at once: OpenCV wants both sides of what it reads short


def read_at(field: NDArray[np.float32], places: NDArray[np.floating]) -> NDArray[np.float32]:
    """Return a field (float32 [rows, cols, channels]) at places ([n, 2] column and row), bilinear: [n, channels]."""
    lines = np.zeros((-(-len(places) // LINE) * LINE, 2), np.float32)
    lines[: len(places)] = places
    x, y = (np.ascontiguousarray(one) for one in lines.reshape(-1, LINE, 2).transpose(2, 0, 1))
    if not len(places):
        return np.zeros((0, field.shape[2]), np.float32)
    read = cv2.remap(field, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(read, np.float32).reshape(-1, field.shape[2])[: len(places)]


def cell_means(pixels: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the mean of pixels [H, W] in each cell, [rows, cols], those at the border of what is inside."""
    rows, cols = (np.arange(0, side, CELL) for side in pixels.shape)
    sums = np.add.reduceat(np.add.reduceat(pixels.astype(np.float64), rows, axis=0), cols, axis=1)
    return sums / np.outer(np.diff(np.append(rows, pixels.shape[0])), np.diff(np.append(cols, pixels.shape[1])))


@dataclass(frozen=True)
class Grid:
    """A regular grid over an image."""

    rows: int
    cols: int
    step_x: float  # pixels of the image between neighbouring centres
    step_y: float

    def centres(self) -> NDArray[np.float32]:
        """Return the centres of all cells, row by row: float32 [rows · cols, 2] pixels."""
        row, col = np.divmod(np.arange(self.rows * self.cols), self.cols)
        return np.stack([(col + 0.5) * self.step_x, (row + 0.5) * self.step_y], axis=1).astype(np.float32)

    def places(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return the place of points [n, 2] pixels on the grid, float64 [n, 2] column and row; a centre is whole."""
        return xy.astype(np.float64) / (self.step_x, self.step_y) - 0.5

    def to_cells(self, values: NDArray[np.float32], height: int, width: int) -> Cells:
        """Return values of this grid, float32 [rows, cols], at the centres of an image's cells, bilinear."""
        rows, cols = grid_shape(height, width)
        x = ((np.arange(cols) + 0.5) * CELL / self.step_x - 0.5).astype(np.float32)
        y = ((np.arange(rows) + 0.5) * CELL / self.step_y - 0.5).astype(np.float32)
        columns, lines = (np.ascontiguousarray(one) for one in np.broadcast_arrays(x, y[:, None]))
        sampled = cv2.remap(values, columns, lines, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(sampled, np.float32)
