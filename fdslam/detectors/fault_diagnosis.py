"""Fault diagnosis (FD): where weak and strong self-localisation disagree, something has changed (§FD, Eq. 1).

For a strong hypothesis m_y each pixel p gets r^(y)[p] = |J[p]| (Σ_{j∈J[p]} 1 / r_j(m_y))⁻¹, the harmonic mean of the
ranks that the OBBs containing p give to m_y; then the minimum over the top-Y hypotheses. A pixel in no OBB gets 0.

Between box edges nothing changes, so the sums are painted with difference arrays on the grid of the distinct edges
instead of on the pixels. Sums of reciprocals are fixed-point integers: the order of the OBBs cannot change a result.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fdslam.config import Fd, part
from fdslam.context import Context, load
from fdslam.localization import RECIPROCAL_ONE, reciprocal
from fdslam.store import Arrays, Stage
from fdslam.types import CELL, Cells, grid_shape

STAGE = Stage("fd", "fdslam.detectors.fault_diagnosis", ("numpy",))
RANK_ONE = 1 << 24  # fixed-point 1.0 of a rank
_POOL: dict[str, Callable[..., NDArray]] = {"min": np.min, "mean": np.mean, "max": np.max, "median": np.median}


def _edges(low: NDArray[np.float32], high: NDArray[np.float32], size: int) -> tuple[NDArray[np.int64], ...]:
    """Return the distinct pixel edges of half-open intervals, and each interval's first and end index among them."""
    first = np.clip(np.ceil(low), 0, size).astype(np.int64)
    end = np.maximum(np.clip(np.ceil(high), 0, size).astype(np.int64), first)
    edges = np.unique(np.concatenate([[0, size], first, end]))
    return edges, np.searchsorted(edges, first), np.searchsorted(edges, end)


def _paint(values: NDArray[np.int64], ys: tuple, xs: tuple) -> NDArray[np.int64]:
    """Sum per-box values [..., J] over the boxes that cover each block of the edge grid: [..., rows, columns]."""
    (y_edges, y0, y1), (x_edges, x0, x1) = ys, xs
    difference = np.zeros((len(y_edges), len(x_edges), *values.shape[:-1]), np.int64)
    moved = np.moveaxis(values, -1, 0)
    for y, x, sign in ((y0, x0, 1), (y0, x1, -1), (y1, x0, -1), (y1, x1, 1)):
        np.add.at(difference, (y, x), sign * moved)
    return np.moveaxis(difference.cumsum(0).cumsum(1)[:-1, :-1], (0, 1), (-2, -1))


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


def _blocks(
    boxes: NDArray[np.float32], ranks: NDArray[np.int32], height: int, width: int, config: Fd
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """LoC on the blocks between edges, with the y and x edges in pixels."""
    ys = _edges(boxes[:, 1], boxes[:, 3], height)
    xs = _edges(boxes[:, 0], boxes[:, 2], width)
    covered = _paint(np.ones(len(boxes), np.int64), ys, xs)
    if ranks.size == 0:  # no OBB that says anything, or no hypothesis to disagree with
        return np.zeros(covered.shape), ys[0], xs[0]
    pool = _POOL[config.pooling]

    def paint(values: NDArray[np.int64]) -> NDArray[np.int64]:
        return _paint(values, ys, xs)

    if config.order == "fuse_then_pool":
        loc = pool(_mean_rank(ranks.T, paint, covered, config.mean), axis=0)
    else:
        loc = _mean_rank(pool(ranks, axis=1), paint, covered, config.mean)
    return loc, ys[0], xs[0]


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
    loc, y_edges, x_edges = _blocks(boxes, ranks, height, width, config)
    return np.repeat(np.repeat(loc, np.diff(y_edges), 0), np.diff(x_edges), 1).astype(np.float32)


def _cell_maximum(values: NDArray[np.float64], edges: NDArray[np.int64], cells: int) -> NDArray[np.float64]:
    """Maximum of blocks (axis 0, between pixel edges) over each cell that they touch."""
    starts = np.arange(cells) * CELL
    fine = np.unique(np.concatenate([edges[:-1], starts]))
    spread = values[np.searchsorted(edges, fine, side="right") - 1]
    return np.maximum.reduceat(spread, np.searchsorted(fine, starts), axis=0)


def loc_cells(boxes: NDArray[np.float32], ranks: NDArray[np.int32], height: int, width: int, config: Fd) -> Cells:
    """Return the LoC of every cell, the maximum of its pixels; arguments as ``loc_pixels``."""
    rows, columns = grid_shape(height, width)
    loc, y_edges, x_edges = _blocks(boxes, ranks, height, width, config)
    tall = _cell_maximum(loc, y_edges, rows)
    return np.ascontiguousarray(_cell_maximum(tall.T, x_edges, columns).T, dtype=np.float32)


def detect(context: Context) -> list[Cells]:
    """Return the LoC of every query (§FD) from its weak ranks of the hypotheses."""
    settings = part(context.config.fd, Fd)

    def cells(query: int) -> Arrays:
        frame, found = context.dataset.query[query], context.localizations[query]
        ranks = found.ranks[:, context.hypotheses[query]]
        return {"loc": loc_cells(found.boxes.xyxy, ranks, frame.height, frame.width, context.config.fd)}

    keys = [
        STAGE.key(settings, [key, *map(str, hypotheses)])
        for key, hypotheses in zip(context.localization_keys, context.hypotheses, strict=True)
    ]
    context.ensure(STAGE, {key: partial(cells, query) for query, key in enumerate(keys)}, "FD")
    return [load(context.store, STAGE, key, partial(cells, query))["loc"] for query, key in enumerate(keys)]
