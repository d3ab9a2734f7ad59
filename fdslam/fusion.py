"""Late fusion: the maps of several detectors become one by their ranks in the pool of all cells (§Performance)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from fdslam.errors import InputError

RULES = ("harmonic", "reciprocal", "stouffer", "fisher")
CHUNK = 1 << 20  # cells that are fused at a time


def competition_ranks(values: NDArray[np.floating]) -> NDArray[np.integer]:
    """Return the rank of each value, 1 for the smallest; equal values share the smallest rank of their group.

    It is ``scipy.stats.rankdata(values, "min")`` in a third of the memory: pools hold up to 1e8 cells.

    Args:
        values: [N], no NaN.

    Returns:
        [N] int32, or int64 where that is not enough.
    """
    order = np.argsort(values)
    rising = values[order]
    ranks: NDArray[np.integer] = np.arange(1, len(values) + 1, dtype=np.int32 if len(values) < 2**31 else np.int64)
    ranks[1:][rising[1:] == rising[:-1]] = 0
    np.maximum.accumulate(ranks, out=ranks)
    placed = np.empty_like(ranks)
    placed[order] = ranks
    return placed


def percentiles(maps: Sequence[NDArray[np.floating]]) -> list[NDArray[np.float32]]:
    """Return each cell's place in the pool of all queries' cells, 0 to 1; ties averaged."""
    pool = np.concatenate([cells.ravel() for cells in maps])
    below, not_above = competition_ranks(pool) - 1, len(pool) + 1 - competition_ranks(-pool)
    places = ((below + not_above) / (2 * len(pool))).astype(np.float32)
    parts = np.split(places, np.cumsum([cells.size for cells in maps])[:-1])
    return [part.reshape(cells.shape) for part, cells in zip(parts, maps, strict=True)]


def fuse(maps: Sequence[Sequence[NDArray[np.floating]]], rule: str) -> list[NDArray[np.float64]]:
    """Fuse the detectors' LoC, cell by cell, by competition ranks over the cells of all queries.

    Equal values share the smallest rank of their group, so a detector that is blind in many cells does not order them.

    - ``harmonic``: ranks ascend with LoC and are fused by Eq. 1, n (Σ 1/r)⁻¹: a cell is as likely changed as the
      harmonic mean of its ranks, so one detector that sees no change vetoes.
    - ``reciprocal``: rank 1 is the most likely changed cell and Σ 1/r is the fused LoC: one sure detector is enough.

    - ``stouffer``: a detector's p-value for a cell is the share of the pool above it, equal cells and itself counting
      half; the fused LoC is the sum of the normal deviates of 1 - p. Detectors that agree add up, and neither one that
      sees nothing nor a sure one decides alone.
    - ``fisher``: the sum of -ln p, nearer to the sure one.

    The n terms of a cell are summed by size, so the result is the same, to the last bit, for any order of the
    detectors and of the queries.

    Args:
        maps: per detector, per query, the LoC [rows, cols] of its cells, no NaN; larger is more likely changed.
        rule: one of ``RULES``.

    Returns:
        Per query [rows, cols] **float64**, larger is more likely changed. Not float32 as other cells: pools hold up to
        1e8 cells, and rounding to 24 bits would tie cells that differ. Keep it so until the cells are ranked.

    Raises:
        InputError: unknown rule, no detector, or detectors whose maps differ in number or shape.
    """
    if rule not in RULES:
        raise InputError(f"fusion rule {rule!r}: choose one of {', '.join(RULES)}")
    if not maps:
        raise InputError("late fusion: no detector given; at least one is needed")
    shapes = [np.shape(cells) for cells in maps[0]]
    if any([np.shape(cells) for cells in detector] != shapes for detector in maps):
        raise InputError("late fusion: the detectors' maps differ in number or shape; use the same queries for all")
    if not shapes:
        return []
    pooled = (np.concatenate([np.ravel(cells) for cells in detector]) for detector in maps)
    ranks = [_ranks(values, rule) for values in pooled]
    fused = np.empty(len(ranks[0]))
    for begin in range(0, len(fused), CHUNK):  # or the terms of a large pool would fill the memory
        part = slice(begin, begin + CHUNK)
        total = sum(np.sort([_term(rank[part], len(fused), rule) for rank in ranks], axis=0))
        fused[part] = len(maps) / total if rule == "harmonic" else total
    parts = np.split(fused, np.cumsum([rows * cols for rows, cols in shapes])[:-1])
    return [part.reshape(shape) for part, shape in zip(parts, shapes, strict=True)]


def _ranks(values: NDArray[np.floating], rule: str) -> NDArray[np.integer]:
    """Return what a rule ranks cells by: ranks from below, from above, or the sum of a group's first and last."""
    if rule == "harmonic":
        return competition_ranks(values)
    above = competition_ranks(-values)
    return above if rule == "reciprocal" else competition_ranks(values).astype(np.int64) + (len(values) + 1 - above)


def _term(rank: NDArray[np.integer], cells: int, rule: str) -> NDArray[np.float64]:
    """Return what a detector adds to the sum of a cell."""
    if rule in ("harmonic", "reciprocal"):
        return 1 / rank
    below = (rank - 1) / (2 * cells)  # the share of the pool below, equal cells counting half
    return ndtri(below) if rule == "stouffer" else -np.log1p(-below)
