"""Controls: LoC that knows nothing of change (§Performance).

A change detector that does not beat them has shown nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import gaussian_filter

from fdslam.coverage import Coverage
from fdslam.metrics.seeds import generator
from fdslam.types import CELL, Cells, grid_shape

SMOOTH = 40  # pixels; σ of the smooth random field
REACH = 4  # the Gaussian is cut off at this many σ


def random(name: str, height: int, width: int, seed: int) -> Cells:
    """Return independent uniform LoC in [0, 1): [rows, cols] float32.

    Args:
        name: of the query; the values depend on it and the seed only.
        height: of the image, pixels.
        width: of the image, pixels.
        seed: of the values.
    """
    return generator(seed, "random", name).random(grid_shape(height, width), dtype=np.float32)


def smooth_random(name: str, height: int, width: int, seed: int) -> Cells:
    """Return white noise smoothed by a Gaussian of σ = 40 pixels: [rows, cols] float32, blobs without meaning.

    The noise is drawn per cell (white noise averaged over a cell is white noise of cells, and within one cell the
    smoothed field hardly changes, so its maximum there is its value). It is drawn beyond the border too, so that the
    field has the same variance everywhere: a reflected border would favour the margin.

    Args:
        name: of the query; the values depend on it and the seed only.
        height: of the image, pixels.
        width: of the image, pixels.
        seed: of the values.
    """
    rows, cols = grid_shape(height, width)
    sigma = SMOOTH / CELL
    margin = int(np.ceil(REACH * sigma))
    noise = generator(seed, "smooth random", name).standard_normal((rows + 2 * margin, cols + 2 * margin))
    field = gaussian_filter(noise, sigma, truncate=REACH)
    return field[margin : margin + rows, margin : margin + cols].astype(np.float32)


def centre_blob(name: str, height: int, width: int, seed: int) -> Cells:
    """Return a Gaussian where objects usually are, at the centres of the cells: [rows, cols] float32 in (0, 1].

    Its centre is at 62 % of the height and 50 % of the width, its σ are 16 % of the height and 30 % of the width.

    Args:
        name: not used.
        height: of the image, pixels.
        width: of the image, pixels.
        seed: not used.
    """
    rows, cols = grid_shape(height, width)
    y = (np.arange(rows) * CELL + np.minimum(np.arange(1, rows + 1) * CELL, height)) / 2  # the last cell may be cut
    x = (np.arange(cols) * CELL + np.minimum(np.arange(1, cols + 1) * CELL, width)) / 2
    vertical, horizontal = (y / height - 0.62) / 0.16, (x / width - 0.50) / 0.30
    return np.exp(-(vertical[:, None] ** 2 + horizontal**2) / 2).astype(np.float32)


def objectness(boxes: ArrayLike, height: int, width: int) -> Cells:
    """Return how many of the boxes cover each pixel, the largest number in each cell: [rows, cols] float32.

    Args:
        boxes: [n, 4] xyxy of a detector's boxes, pixels, half-open; no map is used.
        height: of the image, pixels.
        width: of the image, pixels.
    """
    own = np.asarray(boxes, dtype=np.float32).reshape(-1, 4)
    coverage = Coverage(own, height, width)
    return coverage.cells(coverage.paint(np.ones(len(own), np.int64))).astype(np.float32)


CONTROLS: dict[str, Callable[[str, int, int, int], Cells]] = {
    "random": random,
    "smooth random": smooth_random,
    "centre blob": centre_blob,
}


def control(kind: str, names: Sequence[str], heights: Sequence[int], widths: Sequence[int], seed: int) -> list[Cells]:
    """Return one control's maps of all queries.

    Args:
        kind: a key of ``CONTROLS``.
        names: of the queries.
        heights: of their images, pixels.
        widths: of their images, pixels.
        seed: of the random ones.

    Returns:
        Per query its cells.
    """
    make = CONTROLS[kind]
    return [make(name, h, w, seed) for name, h, w in zip(names, heights, widths, strict=True)]
