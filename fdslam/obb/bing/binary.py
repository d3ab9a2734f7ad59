"""Stage I by bit operations: a filter as two binary ones, a gradient by its four highest bits.

A filter w (8 × 8) becomes β₁a₁ + β₂a₂ with a ∈ {−1, +1}⁶⁴, greedily: a is the sign of what is left of w, β the mean of
its magnitude. With b_k bit 4 + k of the gradients in a window, its score is

    s = Σ_j β_j Σ_{k<4} 2^k (2 |a_j⁺ ∧ b_k| − |b_k|),

where |·| counts ones and a⁺ has ones where a is +1; s is about ⟨w, g⟩ / 16. Windows are 64-bit integers, first weight
in the highest bit, row by row. Source: Cheng et al., CVPR 2014, Algorithm 1 and Eq. 6.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fdslam.native import NATIVE
from fdslam.obb.bing.gradient import Gradient

SIDE = 8  # of a window, pixels of the resized image
Scores = NDArray[np.float32]  # [H - 7, W - 7], of the window whose upper left pixel it is

if NATIVE:
    from fdslam.obb.bing.kernels import score_kernel


def binarise(weights: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.uint64]]:
    """Return β (float64 [2]) and a⁺ (uint64 [2]) of a filter (float32 [8, 8]).

    Sums are rounded once, so that every machine finds the same β.
    """
    rest = [float(value) for value in weights.ravel()]
    beta, signs = [], []
    for _ in range(2):
        size = math.fsum(abs(value) for value in rest) / len(rest)
        beta.append(size)
        signs.append(int("".join("1" if value >= 0 else "0" for value in rest), 2))
        rest = [value - size if value >= 0 else value + size for value in rest]
    return np.array(beta), np.array(signs, np.uint64)


def score_map(gradient: Gradient, beta: NDArray[np.float64], signs: NDArray[np.uint64]) -> Scores:
    """Return the score s of every window, float32 [H - 7, W - 7]; empty where the image is under 8 pixels.

    Args:
        gradient: uint8 [H, W] normed gradient.
        beta: float64 [2], of ``binarise``.
        signs: uint64 [2], of ``binarise``.
    """
    height, width = (max(side - SIDE + 1, 0) for side in gradient.shape)
    if NATIVE:
        scores = np.empty((height, width), np.float32)
        score_kernel(np.ascontiguousarray(gradient), signs[0], signs[1], beta, scores)
        return scores
    every, mine, other = (np.zeros((height, width), np.int64) for _ in range(3))
    for k in range(4):
        window = _windows((gradient >> np.uint8(4 + k)) & np.uint8(1))
        every += np.bitwise_count(window).astype(np.int64) << k
        mine += np.bitwise_count(window & signs[0]).astype(np.int64) << k
        other += np.bitwise_count(window & signs[1]).astype(np.int64) << k
    return (beta[0] * (2 * mine - every) + beta[1] * (2 * other - every)).astype(np.float32)


def _windows(bits: NDArray[np.uint8]) -> NDArray[np.uint64]:
    """Return the 8 × 8 windows of a plane of bits (uint8 [H, W] of 0 and 1) as integers: uint64 [H - 7, W - 7]."""
    height, width = (max(side - SIDE + 1, 0) for side in bits.shape)
    wide = bits.astype(np.uint64)
    rows = np.zeros((len(bits), width), np.uint64)
    for x in range(SIDE if width else 0):
        rows |= wide[:, x : x + width] << np.uint64(SIDE - 1 - x)
    windows = np.zeros((height, width), np.uint64)
    for y in range(SIDE if height else 0):
        windows |= rows[y : y + height] << np.uint64(SIDE * (SIDE - 1 - y))
    return windows
