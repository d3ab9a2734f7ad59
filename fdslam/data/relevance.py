"""Which map images show the place of a query."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def nearest_first(near: NDArray[np.bool_], distance: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the map ids that are ``near`` [M] by rising ``distance`` [M]; int64 [n], ties by id."""
    return np.flatnonzero(near)[np.argsort(distance[near], kind="stable")].astype(np.int64)


def places_by_pose(
    queries: NDArray[np.float64], maps: NDArray[np.float64], radius: float, angle: float
) -> tuple[NDArray[np.int64], ...]:
    """Return per query the map images of its place, nearest first; a query at a time, so that memory stays small.

    Args:
        queries: float64 [Q, 3] x, y in metres, heading in radians.
        maps: float64 [M, 3].
        radius: metres; the same place is at most this far.
        angle: degrees; and looked at in a direction that differs at most by this.

    Returns:
        Per query int64 [n] map ids.
    """
    found = []
    for query in queries:
        distance = np.linalg.norm(query[:2] - maps[:, :2], axis=1)
        turn = np.abs((query[2] - maps[:, 2] + np.pi) % (2 * np.pi) - np.pi)
        found.append(nearest_first((distance <= radius) & (np.degrees(turn) <= angle), distance))
    return tuple(found)
