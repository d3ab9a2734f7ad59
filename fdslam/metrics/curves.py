"""How well LoC tells changed cells from unchanged ones, over all thresholds at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.metrics.kernels import not_above
from fdslam.metrics.scene import Scene


@dataclass(frozen=True, eq=False)
class Curve:
    """What is selected as the threshold falls, at every distinct value that a changed cell has.

    Elsewhere neither recall steps nor F1 can rise, so that nothing is lost and a pool of 1e8 cells stays small.
    """

    above: NDArray[np.int64]  # [t] cells above each value
    selected: NDArray[np.int64]  # [t] cells at or above it
    hits: NDArray[np.int64]  # [t] changed cells at or above it
    cells: int  # N, of all values

    @property
    def steps(self) -> NDArray[np.int64]:
        """[t] changed cells at each value, at least 1."""
        return np.diff(self.hits, prepend=0)


def thresholds(falling: NDArray[np.floating], positive: NDArray[np.bool_]) -> Curve:
    """Count what is selected at every distinct value that a changed cell has, from the largest down.

    Args:
        falling: [N] LoC by falling value, no NaN.
        positive: [N] whether the cell is changed, in the same order.
    """
    changed = np.flatnonzero(positive)
    borders = np.flatnonzero(falling[1:] != falling[:-1])  # the last of every group but the lowest: there may be 1e8
    groups = np.unique(np.searchsorted(borders, changed))
    above, selected = np.zeros(len(groups), np.int64), np.full(len(groups), len(falling))
    above[groups > 0] = borders[groups[groups > 0] - 1] + 1
    inner = groups < len(borders)
    selected[inner] = borders[groups[inner]] + 1
    return Curve(above, selected, np.searchsorted(changed, selected), len(falling))


def auroc(curve: Curve) -> float | None:
    """Return P(a changed cell has a larger LoC than an unchanged one), ties counting half; None without both kinds."""
    changed = int(curve.hits[-1]) if len(curve.hits) else 0
    unchanged = curve.cells - changed
    if not changed or not unchanged:
        return None
    false_above, false = curve.above - (curve.hits - curve.steps), curve.selected - curve.hits
    below = unchanged - (false_above + false) / 2  # unchanged cells below, ties half
    return float(curve.steps @ below / (changed * unchanged))


def average_precision(curve: Curve) -> float | None:
    """Return Σ (recall step × precision), as scikit-learn defines it; None without changed cells."""
    if not len(curve.hits):
        return None
    return float(np.sum(curve.steps * (curve.hits / curve.selected)) / curve.hits[-1])


def f1_max(curve: Curve) -> float | None:
    """Return the largest F1 = 2 hits / (selected + changed) over the thresholds; None without changed cells."""
    if not len(curve.hits):
        return None
    return float(np.max(2 * curve.hits / (curve.selected + curve.hits[-1])))


def location_matrix(ranks: NDArray[np.integer], scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Compare the cells of every box with the same cells of every unchanged query.

    Args:
        ranks: [N] of the scene's cells by their LoC, 0 to N, larger is more likely changed; equal LoC, equal ranks.
        scene: the queries and their objects.

    Returns:
        (a, valid), both [O, U]: a[o, u] = P(a positive cell of box o has a larger LoC than one of the same cells in
        the unchanged query u), ties half; valid where the grids have the same shape and the box has cells. Elsewhere
        a is 0. A map that is the same for both queries gives exactly ½.
    """
    objects = scene.objects
    shape = (len(objects.area), len(scene.unchanged))
    a, valid = np.zeros(shape), np.zeros(shape, dtype=bool)
    shapes = [scene.shapes[q] for q in scene.unchanged]
    for o, (q, cells) in enumerate(zip(objects.query, objects.positive, strict=True)):
        same = np.flatnonzero([grid == scene.shapes[q] for grid in shapes])
        n = len(cells)
        if not n or not len(same):
            continue
        starts = scene.starts[scene.unchanged[same]]
        lost = not_above(np.sort(ranks[cells]), ranks, starts, cells - scene.starts[q])
        a[o, same] = (2 * n * n - lost) / (2 * n * n)
        valid[o, same] = True
    return a, valid


def location_controlled_auroc(a: NDArray[np.float64], valid: NDArray[np.bool_]) -> float | None:
    """Return the mean over boxes of the mean over unchanged queries; None if no box can be compared.

    Where an object is in the image says much about change and nothing about understanding: any fixed map scores ½ here.

    Args:
        a: [O, U] from ``location_matrix``.
        valid: [O, U] from ``location_matrix``.
    """
    number = valid.sum(axis=1)
    usable = number > 0
    if not usable.any():
        return None
    return float(np.mean(a[usable].sum(axis=1) / number[usable]))
