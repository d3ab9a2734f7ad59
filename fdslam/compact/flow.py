"""Where points of one image should be seen in another: the model of ``bow.alignment``, fast for many points.

The affine map is exact. The flow, means of the matches' residuals under Gaussian weights, is computed on a lattice,
where a Gaussian of the plane is a product of two of a line and all sums are products of small matrices, and is read
between.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.bow.alignment import FEWEST, NEAR, WIDE, fitted, with_one
from fdslam.compact.grid import read_at

STEPS = 40  # of the lattice along √(height · width): under half of the narrower Gaussian's σ
Field = NDArray[np.float32]  # [rows, cols, channels] on the lattice


@dataclass(frozen=True)
class Flow:
    """A prediction from one image to another."""

    model: NDArray[np.float64]  # [3, 2] affine map
    field: Field  # flow x and y, pixels; and how many matches are near and in a wider surrounding, weighted
    step: float  # pixels between the points of the lattice; its first is at the image's corner

    def at(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return where points ([n, 2] pixels) should be seen in the other image, float64 [n, 2] pixels."""
        points: NDArray[np.float64] = np.asarray(xy, np.float64)
        return with_one(points) @ self.model + read_at(self.field, points / self.step)[:, :2]

    def confidence(self, xy: NDArray[np.floating]) -> NDArray[np.float32]:
        """Return how many matches are near points ([n, 2] pixels) and how many in a wider surrounding: float32 [n, 2].

        Each counts by the Gaussian that the flow is averaged with; 0 where nothing is known.
        """
        return read_at(self.field, np.asarray(xy, np.float64) / self.step)[:, 2:]


def flow(here: NDArray[np.float32], there: NDArray[np.float32], height: int, width: int) -> Flow:
    """Return the prediction that matches give.

    Args:
        here: float32 [k, 2] pixels, matched keypoints of the one image.
        there: float32 [k, 2] pixels, their partners in the other.
        height: of the one image, pixels.
        width: of the one image, pixels.

    Returns:
        The identity, without confidence, where fewer than FEWEST matches are given.
    """
    side = float(np.sqrt(height * width))
    step = side / STEPS
    rows, cols = (int(np.ceil(n / step)) + 1 for n in (height, width))
    if len(here) < FEWEST:
        return Flow(np.array([[1.0, 0], [0, 1], [0, 0]]), np.zeros((rows, cols, 4), np.float32), step)
    model, a, residual = fitted(here, there, side)
    terms = np.concatenate([residual, np.ones((len(a), 1))], axis=1)  # [k, 3]
    near, wide = (_sums(a, terms, rows, cols, step, sigma * side) for sigma in (NEAR, WIDE))
    prior = wide[..., :2] / (wide[..., 2:] + 1)
    moved = (near[..., :2] + prior) / (near[..., 2:] + 1)
    field = np.concatenate([moved, near[..., 2:], wide[..., 2:]], axis=2)
    return Flow(model, field.astype(np.float32), step)


def _sums(
    at: NDArray[np.float64], terms: NDArray[np.float64], rows: int, cols: int, step: float, sigma: float
) -> NDArray[np.float64]:
    """Return Σ_k exp(-|p - at_k|² / 2σ²) · terms_k at the lattice's points p: float64 [rows, cols, channels]."""
    along_x = np.exp(-((np.arange(cols)[:, None] * step - at[:, 0]) ** 2) / (2 * sigma**2))
    along_y = np.exp(-((np.arange(rows)[:, None] * step - at[:, 1]) ** 2) / (2 * sigma**2))
    return np.stack([(along_y * term) @ along_x.T for term in terms.T], axis=2)
