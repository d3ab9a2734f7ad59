"""Measures beside those of fdslam.metrics: whole boxes instead of cells, and false alarms at a threshold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fdslam.config import Evaluation
from fdslam.metrics import Figure, Scene
from fdslam.metrics.accuracy import EIGHT
from fdslam.metrics.bootstrap import interval, location_replicates, percent_found, resample
from fdslam.metrics.curves import location_controlled_auroc

LEAST = 4  # cells of an alarm


def figure(one: Figure | None, digits: int) -> str:
    """Return a figure with its interval."""
    return f"{one.value:.{digits}f} ({one.low:.{digits}f}–{one.high:.{digits}f})" if one else "–"


def box_mean_matrix(values: NDArray[np.floating], scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Compare the mean LoC of every box with that of the same cells in every unchanged query.

    Args:
        values: [N] LoC of the scene's cells.
        scene: the queries and their objects.

    Returns:
        (a, valid), both [O, U], O as sorted by the scene: a is 1, ½ or 0 as the box's mean is larger, equal or
        smaller; valid where the grids have the same shape and the box has cells. Elsewhere a is 0.
    """
    objects = scene.objects
    shape = (len(objects.area), len(scene.unchanged))
    a, valid = np.zeros(shape), np.zeros(shape, dtype=bool)
    same = [[scene.shapes[u] == scene.shapes[q] for u in scene.unchanged] for q in objects.query]
    for o, (q, cells) in enumerate(zip(objects.query, objects.positive, strict=True)):
        there = np.flatnonzero(same[o])
        if not len(cells) or not len(there):
            continue
        starts = scene.starts[scene.unchanged[there]]
        # One sum over rows of one array: equal cells then have equal means, to the last bit.
        rows = np.concatenate([[scene.starts[q]], starts])[:, None] + (cells - scene.starts[q])
        means = values[rows].astype(np.float64).mean(axis=1)
        a[o, there] = (means[0] > means[1:]) + 0.5 * (means[0] == means[1:])
        valid[o, there] = True
    return a, valid


def _drawn(scene: Scene, config: Evaluation, seed: int) -> NDArray[np.int64]:
    """Return how often each query, sorted by name, is drawn: the draws of ``fdslam.metrics.evaluate``."""
    return resample([scene.image_of(i) for i in scene.by_name], config.bootstrap, seed)


def box_mean_auroc(values: NDArray[np.floating], scene: Scene, config: Evaluation, seed: int) -> Figure | None:
    """Return the mean over boxes of the share of unchanged queries that their mean LoC beats, ties half, 0 to 1.

    Args:
        values: [N] LoC of the scene's cells.
        scene: the queries and their objects.
        config: bootstrap and confidence are used.
        seed: of the draws of queries.
    """
    a, valid = box_mean_matrix(values, scene)
    value = location_controlled_auroc(a, valid)
    if value is None:
        return None
    again = location_replicates(a, valid, scene.objects.query, scene.unchanged, _drawn(scene, config, seed))
    return interval(value, again, config.confidence)


def found_by_area(
    found: NDArray[np.bool_], scene: Scene, parts: int, config: Evaluation, seed: int
) -> list[tuple[float, Figure]]:
    """Return, from the smallest boxes to the largest, the largest area in each part and the percentage found in it.

    Args:
        found: [O] per box as sorted by the scene. The cut is that of all queries, in replicates too.
        scene: the queries and their objects.
        parts: of equally many boxes.
        config: bootstrap and confidence are used.
        seed: of the draws of queries.
    """
    objects, drawn = scene.objects, _drawn(scene, config, seed)
    once = np.ones((1, len(scene.names)), dtype=np.int64)
    figures = []
    for mine in np.array_split(np.argsort(objects.area, kind="stable"), parts):
        if not len(mine):
            continue
        hits, query = found[mine], objects.query[mine]
        value = float(percent_found(hits, query, once)[0])
        figure = interval(value, percent_found(hits, query, drawn), config.confidence)
        figures.append((float(objects.area[mine].max()), figure))
    return figures


def threshold(values: NDArray[np.floating], percent: int) -> float:
    """Return the smallest LoC among the first floor(N percent / 100) cells, at least one, by falling LoC."""
    count = max(1, len(values) * percent // 100)
    return float(np.partition(values, len(values) - count)[len(values) - count])


def alarms(cells: NDArray[np.floating], least_loc: float) -> int:
    """Count the 8-connected components of at least ``LEAST`` cells whose LoC is at least ``least_loc``."""
    labels, count = ndimage.label(cells >= least_loc, structure=EIGHT)
    return int(np.count_nonzero(np.bincount(labels.ravel(), minlength=count + 1)[1:] >= LEAST))


def mean_over(counts: Sequence[int], config: Evaluation, seed: int) -> Figure | None:
    """Return the mean of a count per query with its interval over queries; None without queries."""
    if not len(counts):
        return None
    each = np.asarray(counts, np.float64)
    drawn = resample([str(i) for i in range(len(each))], config.bootstrap, seed)
    return interval(float(each.mean()), drawn @ each / len(each), config.confidence)
