"""Fault diagnosis (FD): where weak and strong self-localisation disagree, something has changed (§FD, Eq. 1).

For a strong hypothesis m_y each pixel p gets r^(y)[p] = |J[p]| (Σ_{j∈J[p]} 1 / r_j(m_y))⁻¹, the harmonic mean of the
ranks that the OBBs containing p give to m_y; then the minimum over the top-Y hypotheses. A pixel in no OBB gets 0.

Sums of reciprocals are fixed-point integers: the order of the OBBs cannot change a result.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fdslam.config import Fd, part
from fdslam.context import Context, Detected
from fdslam.coverage import Coverage
from fdslam.localization import RECIPROCAL_ONE, reciprocal
from fdslam.store import Arrays, Key, Stage
from fdslam.types import Cells

STAGE = Stage("fd", ("fdslam.detectors.fault_diagnosis",), ("numpy",))
RANK_ONE = 1 << 24  # fixed-point 1.0 of a rank
_POOL: dict[str, Callable[..., NDArray]] = {"min": np.min, "mean": np.mean, "max": np.max, "median": np.median}


def _mean_rank(
    ranks: NDArray, paint: Callable[[NDArray[np.int64]], NDArray[np.int64]], covered: NDArray[np.int64], mean: str
) -> NDArray[np.float64]:
    """Mean over J[p] of ranks [..., J] on the edge grid; 0 where no box covers."""
    if mean == "harmonic":
        total = paint(reciprocal(ranks))
        return np.divide(covered * RECIPROCAL_ONE, total, out=np.zeros(total.shape), where=total > 0)
    total = paint(np.rint(ranks * RANK_ONE).astype(np.int64))  # pooled first, a rank need not be whole
    return np.divide(
        total, RANK_ONE * covered, out=np.zeros(total.shape), where=np.broadcast_to(covered > 0, total.shape)
    )


def _blocks(coverage: Coverage, ranks: NDArray[np.int32], config: Fd) -> NDArray[np.float64]:
    """LoC on the blocks of the coverage."""
    covered = coverage.paint(np.ones(len(ranks), np.int64))
    if ranks.size == 0:  # no OBB that says anything, or no hypothesis to disagree with
        return np.zeros(covered.shape)
    pool = _POOL[config.pooling]
    if config.order == "fuse_then_pool":
        return pool(_mean_rank(ranks.T, coverage.paint, covered, config.mean), axis=0)
    return _mean_rank(pool(ranks, axis=1), coverage.paint, covered, config.mean)


def loc_pixels(
    boxes: NDArray[np.float32], ranks: NDArray[np.int32], height: int, width: int, config: Fd
) -> NDArray[np.float32]:
    """Return the LoC of every pixel.

    Args:
        boxes: float32 [J, 4] xyxy pixels, half-open: the OBBs.
        ranks: int32 [J, Y], r_j(m_y): the rank that weak list j gives to each of the top-Y strong hypotheses.
        height: of the image, pixels.
        width: of the image, pixels.
        config: pooling, order, mean.

    Returns:
        float32 [height, width], 1 … M inside any OBB, 0 outside all.
    """
    coverage = Coverage(boxes, height, width)
    return coverage.pixels(_blocks(coverage, ranks, config)).astype(np.float32)


def loc_cells(boxes: NDArray[np.float32], ranks: NDArray[np.int32], height: int, width: int, config: Fd) -> Cells:
    """Return the LoC of every cell, the maximum of its pixels; arguments as ``loc_pixels``."""
    coverage = Coverage(boxes, height, width)
    return coverage.cells(_blocks(coverage, ranks, config)).astype(np.float32)


def _keys(context: Context) -> list[Key]:
    return [
        STAGE.key(part(context.config.fd, Fd), [key, *map(str, hypotheses)])
        for key, hypotheses in zip(context.localization_keys, context.hypotheses, strict=True)
    ]


def missing(context: Context) -> int:
    """Count the queries without a stored result."""
    return context.store.lacks(STAGE, _keys(context))


def detect(context: Context) -> Detected:
    """Return the LoC of every query (§FD) from its weak ranks of the hypotheses; nothing more of the map is kept."""

    def cells(query: int) -> Arrays:
        frame, found = context.dataset.query[query], context.localizations[query]
        ranks = found.ranks[:, context.hypotheses[query]].astype(np.int32)
        return {"loc": loc_cells(found.boxes.xyxy, ranks, frame.height, frame.width, context.config.fd)}

    return Detected([arrays["loc"] for arrays in context.fetch(STAGE, _keys(context), cells, "FD")], kept=0.0)
