"""Percentile intervals: the queries are drawn again with replacement, everything else follows exactly.

A replicate is a vector w of multiplicities: query q counts w_q times. All figures are computed from counts per query,
so that a thousand replicates are matrix products instead of a thousand evaluations. Copies of a cell are one cell of
larger weight: it is selected if all its copies fit under the cut. Replicates in which a figure is undefined (no changed
cell drawn, say) are NaN here and left out of the interval.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.metrics.accuracy import cut, prefix_counts
from fdslam.metrics.curves import Curve
from fdslam.metrics.seeds import generator

STEPS = 16_384  # thresholds of a replicated curve; beyond, neighbours are merged (see ``curve_steps``)
CHUNK = 8 * 2**20  # bytes of working arrays at a time

Weights = NDArray[np.int64]  # [R, Q] w: how often each query, sorted by name, is drawn in each replicate


@dataclass(frozen=True)
class Figure:
    """A number with its interval. Accuracies and recalls in percent, areas and F1 in 0 to 1."""

    value: float
    low: float
    high: float


def resample(images: Sequence[str], replicates: int, seed: int) -> Weights:
    """Draw as many images as there are, with replacement, ``replicates`` times.

    Args:
        images: [Q] the image of each query. Queries that are one image, seen against several maps, are drawn together:
            they are no independent observations.
        replicates: R.
        seed: of the draws.

    Returns:
        [R, Q] how often each query was drawn.
    """
    if not len(images):
        return np.zeros((replicates, 0), dtype=np.int64)
    distinct, image = np.unique(np.asarray(images), return_inverse=True)
    count = len(distinct)
    drawn = generator(seed, "bootstrap").multinomial(count, np.full(count, 1 / count), size=replicates)
    return np.asarray(drawn[:, image], np.int64)


def interval(value: float, replicates: NDArray[np.float64], confidence: float) -> Figure:
    """Return the figure with its percentile interval.

    Args:
        value: the point estimate, from all queries once.
        replicates: [R], NaN where undefined. If all are, the interval is the value alone.
        confidence: 0 to 1.
    """
    defined = replicates[~np.isnan(replicates)]
    if not len(defined):
        return Figure(value, value, value)
    low, high = np.quantile(defined, [(1 - confidence) / 2, (1 + confidence) / 2])
    return Figure(float(value), float(low), float(high))


def _ratio(part: NDArray[np.float64], whole: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return part / whole, NaN where the whole is 0."""
    return np.divide(part, whole, out=np.full(np.shape(part), np.nan), where=whole > 0)


def percent_found(found: NDArray[np.bool_], query: NDArray[np.int64], weights: Weights) -> NDArray[np.float64]:
    """Return the percentage of found objects in every replicate.

    Args:
        found: [O], or [R, O] if it differs between replicates.
        query: [O] the query of each object.
        weights: [R, Q].

    Returns:
        [R] percent; NaN where no object was drawn.
    """
    drawn = weights[:, query]
    return _ratio(100.0 * np.sum(drawn * found, axis=1), np.sum(drawn, axis=1).astype(np.float64))


def proportion(
    hits: NDArray[np.bool_],
    names: Sequence[str],
    replicates: int,
    confidence: float,
    seed: int,
    images: Sequence[str] | None = None,
) -> Figure | None:
    """Return the percentage of queries that hit, e.g. a recall, with its interval.

    Args:
        hits: [Q] per query.
        names: [Q] unique names of the queries; their order changes nothing.
        replicates: number of resamplings.
        confidence: 0 to 1.
        seed: of the resampling.
        images: [Q] the image of each query, where several queries are one.

    Returns:
        Percent; None if there are no queries.
    """
    if not len(names):
        return None
    order = sorted(range(len(names)), key=names.__getitem__)
    ordered, drawn = np.asarray(hits, dtype=bool)[order], [(images or names)[i] for i in order]
    each, once = np.arange(len(names)), np.ones((1, len(names)), dtype=np.int64)
    value = percent_found(ordered, each, once)[0]
    return interval(value, percent_found(ordered, each, resample(drawn, replicates, seed)), confidence)


def location_replicates(
    a: NDArray[np.float64],
    valid: NDArray[np.bool_],
    query: NDArray[np.int64],
    unchanged: NDArray[np.int64],
    weights: Weights,
) -> NDArray[np.float64]:
    """Return the location-controlled AUROC in every replicate.

    Args:
        a: [O, U] from ``location_matrix``.
        valid: [O, U] from ``location_matrix``.
        query: [O] the query of each object.
        unchanged: [U] the unchanged queries.
        weights: [R, Q]; it multiplies boxes and unchanged queries alike.

    Returns:
        [R], NaN where no drawn box has a drawn unchanged query to compare with.
    """
    drawn = weights[:, unchanged].astype(float)
    whole = drawn @ valid.T.astype(float)
    part = np.einsum("ru,ou->ro", drawn, a)  # not BLAS: its rounding may depend on the number of threads
    mean = np.divide(part, whole, out=np.zeros_like(whole), where=whole > 0)
    times = weights[:, query] * (whole > 0)
    return _ratio(np.sum(times * mean, axis=1), np.sum(times, axis=1).astype(float))


def found_in_pool(
    needed: NDArray[np.int64],
    order: NDArray[np.integer],
    sizes: NDArray[np.int64],
    weights: Weights,
    percents: Sequence[int],
) -> NDArray[np.bool_]:
    """Tell which objects are found in every replicate, all cells ranked together (criterion ``coverage``).

    With C[o, q] = number of cells of q among the first p_o of the pooled order, an object is found if and only if
    (C w)[o] <= floor(X % of Σ w_q n_q).

    Args:
        needed: [O] p_o.
        order: [N] the query of each cell, in the pooled order.
        sizes: [Q] n_q.
        weights: [R, Q].
        percents: the x values of X.

    Returns:
        [x, R, O] bool.
    """
    reachable = needed <= len(order)
    cuts, back = np.unique(needed[reachable], return_inverse=True)
    before = np.full((len(weights), len(needed)), np.inf)
    # float64 for speed (BLAS); counts below 2^53 stay exact
    before[:, reachable] = (weights.astype(float) @ prefix_counts(order, cuts, len(sizes)).T.astype(float))[:, back]
    total = weights @ sizes
    return np.stack([before <= cut(total, x)[:, None] for x in percents])


def selected_in_pool(
    order: NDArray[np.integer], sizes: NDArray[np.int64], weights: Weights, percents: Sequence[int]
) -> NDArray[np.int64]:
    """Return how many cells of every query are selected in every replicate, all cells ranked together.

    Args:
        order: [N] the query of each cell, in the pooled order.
        sizes: [Q] n_q.
        weights: [R, Q].
        percents: the x values of X.

    Returns:
        [x, R, Q]: the most cells of the pooled order whose weights sum to at most floor(X % of Σ w_q n_q).
    """
    most = np.stack([cut(weights @ sizes, x) for x in percents], axis=1)
    number = np.array([np.searchsorted(np.cumsum(w[order]), k, "right") for w, k in zip(weights, most, strict=True)])
    cuts, back = np.unique(number, return_inverse=True)
    return prefix_counts(order, cuts, len(sizes))[back.reshape(number.shape).T]


def curve_steps(curve: Curve, most: int = STEPS) -> NDArray[np.int64]:
    """Return where the groups of equal values that hold a changed cell begin and end.

    More than ``most`` groups are merged with their neighbours into that many: pairs inside a merged group count as
    ties, and every recall step of the curve is about 1 / most, so that areas move by less than 1e-4. Only intervals
    use this, never a point estimate.

    Args:
        curve: of the point estimates.
        most: number of groups.

    Returns:
        [g, 2] half-open intervals of places in the order.
    """
    steps = np.stack([curve.above, curve.selected], axis=1)
    if len(steps) <= most:
        return steps
    last = np.arange(1, most + 1) * len(steps) // most
    return np.stack([steps[np.concatenate([[0], last[:-1]]), 0], steps[last - 1, 1]], axis=1)


def _curve_counts(
    steps: NDArray[np.int64], query: NDArray[np.integer], positive: NDArray[np.bool_], queries: int, chunk: int
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Yield for ``chunk`` steps at a time the changed and all cells of each query before begin and end: [c, 2, Q]."""
    carry = np.zeros((2, queries), dtype=np.int64)
    done = 0
    for i in range(0, len(steps), chunk):
        part = steps[i : i + chunk]
        cuts, stop = part.ravel() - done, part[-1, 1]
        some, mask = query[done:stop], positive[done:stop]
        hits_before = np.concatenate([[0], np.cumsum(mask)])
        hits = prefix_counts(some[mask], hits_before[cuts], queries) + carry[0]
        cells = prefix_counts(some, cuts, queries) + carry[1]
        carry, done = np.stack([hits[-1], cells[-1]]), stop
        yield hits.reshape(-1, 2, queries).astype(float), cells.reshape(-1, 2, queries).astype(float)


def curve_replicates(
    steps: NDArray[np.int64], query: NDArray[np.integer], positive: NDArray[np.bool_], weights: Weights
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return AUROC, average precision and F1-max of the cells in every replicate.

    AUROC is w U w / (changed · unchanged) with U[p, n] = the Mann-Whitney count of p's changed cells against n's
    unchanged ones, ties half. The other two need the weighted counts at every threshold, a chunk at a time.

    Args:
        steps: [g, 2] from ``curve_steps``.
        query: [N] the query of each cell, in the pooled order.
        positive: [N] in the same order.
        weights: [R, Q].

    Returns:
        Three arrays [R], NaN where undefined.
    """
    replicates, queries = weights.shape
    w = weights.astype(float)
    changed_of = np.bincount(query[positive], minlength=queries)
    unchanged_of = np.bincount(query[~positive], minlength=queries)
    changed: NDArray[np.float64] = w @ changed_of
    unchanged: NDArray[np.float64] = w @ unchanged_of
    wins = np.zeros((queries, queries))
    area, best, hits = np.zeros(replicates), np.zeros(replicates), np.zeros((1, replicates))
    chunk = max(1, CHUNK // (8 * (8 * queries + 4 * replicates)))
    for hits_of, cells_of in _curve_counts(steps, query, positive, queries, chunk):
        false = cells_of - hits_of
        wins += (hits_of[:, 1] - hits_of[:, 0]).T @ (unchanged_of - (false[:, 0] + false[:, 1]) / 2)
        hits = np.concatenate([hits[-1:], hits_of[:, 1] @ w.T])
        cells = cells_of[:, 1] @ w.T
        step, hit = np.diff(hits, axis=0), hits[1:]
        area += np.einsum("gr,gr->r", step, hit / np.maximum(cells, 1))
        best = np.maximum(best, np.max(2 * hit / np.maximum(cells + changed, 1), axis=0))
    ranked = np.einsum("rp,rp->r", w @ wins, w)
    pairs: NDArray[np.float64] = changed * unchanged
    return _ratio(ranked, pairs), _ratio(area, changed), np.where(changed > 0, best, np.nan)
