"""Which method is best on each object: solo-leader and co-leader ratios (§Performance)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Leader:
    """How often one method leads."""

    solo: float  # percent of the objects where it is strictly the best method
    co: float  # percent of the objects where it ties with another for the best


def grade(found: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return each object's grade.

    Args:
        found: [x, O] whether it is found at the x-th of the ascending percentages X; x at least 1.

    Returns:
        [O] index of the smallest X that finds it, 0 best; x ("otherwise") if none does. With X = 5, 10, 15, 20 these
        are the paper's five grades.
    """
    return np.where(found.any(axis=0), found.argmax(axis=0), len(found))


def leaders(grades: Mapping[str, NDArray[np.int64]], otherwise: int) -> dict[str, Leader] | None:
    """Compare the methods object by object.

    Args:
        grades: per method the grade [O] of every object, the objects in the same order everywhere.
        otherwise: the grade of an object that is not found; nobody leads with it.

    Returns:
        Per method its ratios in percent; None if there are no methods or no objects.
    """
    if not grades or not all(len(g) for g in grades.values()):
        return None
    table = np.stack(list(grades.values()))
    leads = (table == table.min(axis=0)) & (table < otherwise)
    alone = leads.sum(axis=0) == 1
    solo, co = 100.0 * np.mean(leads & alone, axis=1), 100.0 * np.mean(leads & ~alone, axis=1)
    return {name: Leader(float(s), float(c)) for name, s, c in zip(grades, solo, co, strict=True)}
