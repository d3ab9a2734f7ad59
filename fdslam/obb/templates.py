"""The fixed templates of the OBB library (fig. C): sets of boxes, each a combination of cells of a grid on the image.

The paper's figure with the letters is lost; these are ours, on a grid of 6 rows × 4 columns. Everything is a fraction
of the image, so a template is the same at every size; edges are rounded to whole pixels, and neighbours share an edge.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fdslam.types import Image

ROWS, COLUMNS = 6, 4


def _windows(height: float, width: float, tops: list[float], lefts: list[float]) -> list[tuple[float, ...]]:
    return [(left, top, left + width, top + height) for top, left in product(tops, lefts)]


def _steps(count: int, step: float) -> list[float]:
    return [i * step for i in range(count)]


_CELL_H, _CELL_W = 1 / ROWS, 1 / COLUMNS
TEMPLATES: dict[str, list[tuple[float, ...]]] = {  # name -> boxes (x0, y0, x1, y1) as fractions of width and height
    "A": _windows(1, 1, [0], [0]),  # the whole image
    "B": _windows(1 / 2, 1 / 2, _steps(2, 1 / 2), _steps(2, 1 / 2)),  # quadrants
    "C": _windows(1, 1 / 2, [0], _steps(2, 1 / 2)),  # left and right half
    "D": _windows(1 / 3, 1, _steps(3, 1 / 3), [0]),  # horizontal thirds
    "E": _windows(1 / 2, 1 / 2, [1 / 4], [1 / 4]),  # the centre
    "F": _windows(1, 1 / 2, [0], _steps(3, 1 / 4)),  # overlapping vertical strips
    "G": _windows(1 / 2, 1, _steps(3, 1 / 4), [0]),  # overlapping horizontal bands
    "H": _windows(1 / 2, 1 / 2, _steps(3, 1 / 4), _steps(3, 1 / 4)),  # half-size windows
    "I": _windows(2 * _CELL_H, 2 * _CELL_W, _steps(3, 2 * _CELL_H), _steps(2, 2 * _CELL_W)),  # disjoint 2×2 blocks
    "J": _windows(2 * _CELL_H, 2 * _CELL_W, _steps(5, _CELL_H), _steps(3, _CELL_W)),  # 2×2 windows, one cell apart
}


def template_boxes(name: str, height: int, width: int) -> NDArray[np.float32]:
    """Return the boxes of template ``name`` as float32 [n, 4] xyxy pixels, half-open, for an image of that size."""
    fractions = np.array(TEMPLATES[name])
    return np.rint(fractions * [width, height, width, height]).astype(np.float32)


@dataclass(frozen=True)
class Template:
    """A fixed template as a source of OBBs."""

    name: str
    module: ClassVar[str] = ""
    identity: ClassVar[dict[str, str]] = {}

    def boxes(self, image: Image) -> NDArray[np.float32]:
        """Return the boxes for an image of that size, float32 [n, 4] xyxy pixels, half-open."""
        return template_boxes(self.name, *image.shape[:2])
