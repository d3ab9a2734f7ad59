"""One row of the table: everything that is measured of one method, with intervals (§Performance)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.config import Evaluation
from fdslam.metrics import accuracy, bootstrap, curves
from fdslam.metrics.accuracy import Ranking
from fdslam.metrics.bootstrap import Figure, Weights
from fdslam.metrics.leaders import grade
from fdslam.metrics.scene import Scene


@dataclass(frozen=True, eq=False)
class Row:
    """One method's figures. None: not defined for these queries (no boxes, no unchanged queries, …)."""

    method: str
    pooled: dict[int, Figure | None]  # X -> percent of the objects found, all cells ranked together
    per_query: dict[int, Figure | None]  # X -> percent of the objects found, cells ranked within each query
    auroc: Figure | None  # of the cells, 0 to 1
    lc_auroc: Figure | None  # location-controlled: any fixed map has 0.5
    ap: Figure | None  # average precision of the cells
    f1_max: Figure | None  # of the cells
    grades: NDArray[np.int64]  # [O] per box as listed: index of the smallest X (pooled) that finds it, or their number
    found_at: NDArray[np.float64] | None  # [O] per box: percent of the cells it takes; None: no one number (iou)

    @property
    def areas(self) -> dict[str, Figure | None]:
        """What does not depend on X, by the name under which it is shown."""
        return {"AUROC": self.auroc, "lc-AUROC": self.lc_auroc, "AP": self.ap, "F1-max": self.f1_max}


def evaluate(name: str, loc: Sequence[NDArray[np.floating]], scene: Scene, config: Evaluation, seed: int) -> Row:
    """Measure one method.

    Args:
        name: of the method.
        loc: per query of the scene, as listed, the LoC [rows, cols] of its cells, float32 or float64.
        scene: the queries and their changed objects. Use the same one for all methods: it remembers what they share.
        config: X, criterion, found, bootstrap and confidence are used.
        seed: of ties and resampling; the same seed draws the same queries for every method.

    Returns:
        The row. It depends neither on the order of queries and boxes nor on anything but the order of the LoC values.

    Raises:
        InputError: a map is missing, has the wrong shape or holds NaN.
    """
    percents = sorted(set(config.X))
    values = scene.flatten(name, loc)
    del loc  # of a large pool it is GBs
    ranking = accuracy.rank_cells(values, scene, seed)
    falling = values[ranking.order]
    del values
    weights = bootstrap.resample([scene.image_of(i) for i in scene.by_name], config.bootstrap, seed)
    measure = _by_iou if config.criterion == "iou" else _by_coverage
    found_pooled, found_within = measure(ranking, scene, config.found, weights, percents)
    grades = np.empty(len(scene.objects.area), dtype=np.int64)
    grades[scene.objects.listed] = grade(found_pooled[:, 0])
    found_at = None
    if config.criterion == "coverage":
        found_at = np.empty(len(grades))
        needed = accuracy.needed_positions(ranking.position, scene, config.found)
        found_at[scene.objects.listed] = 100.0 * needed / max(len(falling), 1)
    auroc, ap, f1_max = _curves(falling, ranking, scene, weights, config.confidence)
    return Row(
        method=name,
        pooled=_accuracies(found_pooled, percents, scene, weights, config.confidence),
        per_query=_accuracies(found_within, percents, scene, weights, config.confidence),
        auroc=auroc,
        lc_auroc=_location(ranking.tied(falling), scene, weights, config.confidence),
        ap=ap,
        f1_max=f1_max,
        grades=grades,
        found_at=found_at,
    )


def _once(scene: Scene) -> Weights:
    """Return the weights of the scene itself, every query once: [1, Q]."""
    return np.ones((1, len(scene.names)), dtype=np.int64)


def _by_coverage(
    ranking: Ranking, scene: Scene, found: float, weights: Weights, percents: list[int]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which objects are found, pooled and within their query: [x, 1 + R, O], the scene itself first."""
    query = scene.objects.query
    needed = accuracy.needed_positions(ranking.position, scene, found)
    point = [needed <= accuracy.cut(len(ranking.order), x) for x in percents]
    again = bootstrap.found_in_pool(needed, scene.query_of[ranking.order], scene.sizes, weights, percents)
    within = accuracy.needed_positions(ranking.within, scene, found)
    fixed = np.stack([within <= accuracy.cut(scene.sizes[query], x) for x in percents])
    return (
        np.concatenate([np.stack(point)[:, None], again], axis=1),
        np.repeat(fixed[:, None], 1 + len(weights), axis=1),
    )


def _by_iou(
    ranking: Ranking, scene: Scene, found: float, weights: Weights, percents: list[int]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the same by the IoU with connected components of the selected cells: [x, 1 + R, O]."""
    every = np.concatenate([_once(scene), weights])
    chosen = bootstrap.selected_in_pool(scene.query_of[ranking.order], scene.sizes, every, percents)
    pooled = accuracy.found_by_iou(ranking.within, chosen.reshape(-1, len(scene.names)), scene, found)
    own = np.stack([accuracy.cut(scene.sizes, x) for x in percents])
    fixed = accuracy.found_by_iou(ranking.within, own, scene, found)
    return pooled.reshape(len(percents), len(every), -1), np.repeat(fixed[:, None], len(every), axis=1)


def _accuracies(
    found: NDArray[np.bool_], percents: list[int], scene: Scene, weights: Weights, confidence: float
) -> dict[int, Figure | None]:
    """Turn [x, 1 + R, O] found objects into percentages with intervals."""
    query = scene.objects.query
    if not len(query):
        return dict.fromkeys(percents)
    figures: dict[int, Figure | None] = {}
    for x, hits in zip(percents, found, strict=True):
        value = bootstrap.percent_found(hits[0], query, _once(scene))[0]
        figures[x] = bootstrap.interval(value, bootstrap.percent_found(hits[1:], query, weights), confidence)
    return figures


def _curves(
    falling: NDArray[np.floating], ranking: Ranking, scene: Scene, weights: Weights, confidence: float
) -> tuple[Figure | None, Figure | None, Figure | None]:
    """Return AUROC, average precision and F1-max of the cells."""
    positive = scene.positive[ranking.order]
    curve = curves.thresholds(falling, positive)
    estimates = (curves.auroc(curve), curves.average_precision(curve), curves.f1_max(curve))
    if estimates[1] is None:
        return None, None, None
    steps = bootstrap.curve_steps(curve)
    replicates = bootstrap.curve_replicates(steps, scene.query_of[ranking.order], positive, weights)
    auroc, ap, f1_max = (
        None if value is None else bootstrap.interval(value, again, confidence)
        for value, again in zip(estimates, replicates, strict=True)
    )
    return auroc, ap, f1_max


def _location(ranks: NDArray[np.integer], scene: Scene, weights: Weights, confidence: float) -> Figure | None:
    """Return the location-controlled AUROC."""
    a, valid = curves.location_matrix(ranks, scene)
    value = curves.location_controlled_auroc(a, valid)
    if value is None:
        return None
    again = bootstrap.location_replicates(a, valid, scene.objects.query, scene.unchanged, weights)
    return bootstrap.interval(value, again, confidence)
