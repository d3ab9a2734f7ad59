"""Where the keypoints of one image should be seen in another of the same place, from the matches of the two.

An affine map takes in the change of the viewpoint, and the residuals of the matches around a point its parallax. Away
from all matches the affine map alone is left. Lengths are shares of the image's side √(height · width).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FEWEST = 6  # matches; with fewer, nothing is known to have moved
STEPS = 5  # of iteratively reweighted least squares
SCALE = 0.015  # residual at which a match has half its weight
STRAY = 0.15  # a match whose residual is larger in x or y is none
NEAR, WIDE = 0.053, 0.16  # σ of the Gaussians that average residuals; the wide one is the prior of the near one


def predicted(
    xy: NDArray[np.float32], here: NDArray[np.float32], there: NDArray[np.float32], side: float
) -> NDArray[np.float64]:
    """Return where points of one image should be seen in another.

    Args:
        xy: float32 [n, 2] pixels, points of the one image.
        here: float32 [k, 2] pixels, matched keypoints of the one image.
        there: float32 [k, 2] pixels, their partners in the other.
        side: √(height · width) of the image, pixels.

    Returns:
        float64 [n, 2] pixels; the points themselves where fewer than FEWEST matches are given.

    Source: METHOD's recipe for the compact map, by least squares instead of RANSAC, as the matches are verified.
    """
    points: NDArray[np.float64] = xy.astype(np.float64)
    if len(here) < FEWEST:
        return points
    model, a, residual = fitted(here, there, side)
    # A sum along so short an axis as x and y takes longer than all the rest.
    squared = np.subtract.outer(points[:, 0], a[:, 0]) ** 2
    squared += np.subtract.outer(points[:, 1], a[:, 1]) ** 2
    prior = _averaged(squared, residual, WIDE * side, 0.0)
    flow = _averaged(squared, residual, NEAR * side, prior)
    return with_one(points) @ model + flow


def _averaged(
    squared: NDArray[np.float64], residual: NDArray[np.float64], sigma: float, prior: NDArray[np.float64] | float
) -> NDArray[np.float64]:
    """Return residuals [k, 2] averaged by a Gaussian of squared distances [n, k], with one of ``prior``: [n, 2]."""
    weight = squared / -(2 * sigma**2)
    np.exp(weight, out=weight)
    return np.asarray((weight @ residual + prior) / (weight.sum(axis=1, keepdims=True) + 1))


def fitted(
    here: NDArray[np.float32], there: NDArray[np.float32], side: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the affine map [3, 2] of matches (arguments as ``predicted``), and those that are none of its strays.

    Of these float64 [k, 2] each: where they are in the one image, and what the map leaves of them in the other.
    """
    a, b = here.astype(np.float64), there.astype(np.float64)
    model = _affine(a, b, SCALE * side)
    residual = b - with_one(a) @ model
    kept = np.abs(residual).max(axis=1) <= STRAY * side
    return model, a[kept], residual[kept]


def with_one(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points [n, 2] with a third coordinate 1."""
    return np.concatenate([xy, np.ones((len(xy), 1))], axis=1)


def _affine(a: NDArray, b: NDArray, scale: float) -> NDArray[np.float64]:
    """Return the affine map [3, 2] from a to b, fitted with weights 1 / (1 + (residual / scale)²); scale in pixels."""
    rows, weight = with_one(a), np.ones(len(a))
    model = np.zeros((3, 2))
    for _ in range(STEPS):
        root = np.sqrt(weight)[:, None]
        model = np.linalg.lstsq(rows * root, b * root, rcond=None)[0]
        weight = 1 / (1 + ((rows @ model - b) ** 2).sum(axis=1) / scale**2)
    return model
