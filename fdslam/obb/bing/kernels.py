"""The compiled loop of the score maps. Only machines with numba import it; binary.py has the same without.

What a kernel calls stands in this one file: a compiled kernel is kept on disk until the file that it stands in changes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic as _intrinsic

from fdslam.native import njit

intrinsic: Any = _intrinsic  # inside a kernel the first argument, the typing context, is not given


@intrinsic
def ones(context, bits):
    """Return how many bits of a 64-bit integer are set."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.ctpop(arguments[0])

    return types.int64(types.uint64), generate


@njit
def score_kernel(gradient, first, second, beta, scores):
    """Write the score of every 8 × 8 window of ``gradient`` to ``scores``.

    The 64 bits of a window are those of the window above, moved on by one row of eight, and the last eight bits of the
    running row: each pixel is read once.
    """
    height, width = gradient.shape
    rows = np.zeros((width, 4), np.uint64)
    eight = np.uint64(8)
    byte = np.uint64(0xFF)
    one = np.uint64(1)
    for y in range(height):
        r0 = r1 = r2 = r3 = np.uint64(0)
        for x in range(width):
            g = np.uint64(gradient[y, x])
            r0 = ((r0 << one) | ((g >> np.uint64(4)) & one)) & byte
            r1 = ((r1 << one) | ((g >> np.uint64(5)) & one)) & byte
            r2 = ((r2 << one) | ((g >> np.uint64(6)) & one)) & byte
            r3 = ((r3 << one) | (g >> np.uint64(7))) & byte
            b0 = (rows[x, 0] << eight) | r0
            b1 = (rows[x, 1] << eight) | r1
            b2 = (rows[x, 2] << eight) | r2
            b3 = (rows[x, 3] << eight) | r3
            rows[x, 0] = b0
            rows[x, 1] = b1
            rows[x, 2] = b2
            rows[x, 3] = b3
            if y >= 7 and x >= 7:
                every = ones(b0) + 2 * ones(b1) + 4 * ones(b2) + 8 * ones(b3)
                mine = ones(first & b0) + 2 * ones(first & b1) + 4 * ones(first & b2) + 8 * ones(first & b3)
                other = ones(second & b0) + 2 * ones(second & b1) + 4 * ones(second & b2) + 8 * ones(second & b3)
                scores[y - 7, x - 7] = np.float32(beta[0] * (2 * mine - every) + beta[1] * (2 * other - every))
