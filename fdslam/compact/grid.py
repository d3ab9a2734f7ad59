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
