"""The path through the campus and the poses of the two sessions on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus.seeds import stream

LENGTH = 192.0  # metres around the loop
SPACING = 2.0  # metres between map images, at most
SHIFT = 1.0  # metres: largest sideways shift of a query
YAW = np.deg2rad(3.0)  # standard deviation of a query's heading about the path's


@dataclass(frozen=True)
class Route:
    """A closed smooth path, sampled evenly by its length."""

    points: NDArray[np.float64]  # [n, 2] metres, about every 0.25 m, the last one step before the first

    def at(self, s: float | NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the points [..., 2] at ``s`` metres along the path."""
        n = len(self.points)
        k = np.asarray(s, float) / LENGTH * n
        i = np.floor(k).astype(int)
        f = (k - i)[..., None]
        return self.points[i % n] * (1 - f) + self.points[(i + 1) % n] * f

    def heading(self, s: float | NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the direction of travel [...] in radians, smoothed over two metres."""
        d = self.at(np.asarray(s, float) + 1.0) - self.at(np.asarray(s, float) - 1.0)
        angle: NDArray[np.float64] = np.arctan2(d[..., 1], d[..., 0])
        return angle

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance [n] of points [n, 2] from the path, metres."""
        d: NDArray[np.float64] = np.linalg.norm(points[:, None] - self.points[::2], axis=2).min(1)
        return d


def route(seed: int) -> Route:
    """Return the campus's path: a loop of LENGTH metres, bent by the seed."""
    rng = stream(seed, "route")
    angle = np.linspace(0, 2 * np.pi, 4000, endpoint=False)
    a, b = rng.uniform(0, 2 * np.pi, 2)
    radius = 1 + rng.uniform(0.1, 0.16) * np.cos(2 * angle + a) + rng.uniform(0.08, 0.12) * np.cos(3 * angle + b)
    xy = np.stack([1.25 * radius * np.cos(angle), 0.9 * radius * np.sin(angle)], axis=1)
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(xy, axis=0, append=xy[:1]), axis=1))])
    xy = (xy - xy.mean(0)) * LENGTH / along[-1]
    even = np.linspace(0, along[-1], int(LENGTH * 4), endpoint=False)
    closed = np.concatenate([xy, xy[:1]])
    return Route(np.stack([np.interp(even, along, closed[:, k]) for k in (0, 1)], axis=1))


def pose(route: Route, seed: int, session: str, index: int, maps: int, queries: int) -> tuple[float, float, float]:
    """Return where an image is taken.

    The map session stands every SPACING metres or closer, so that its images go around the loop once if there are
    enough of them; the queries are spread over the same stretch, between the map's positions and beside them.

    Args:
        route: the path.
        seed: the world's seed.
        session: "map" or "query".
        index: of the image in its session.
        maps: number of map images.
        queries: number of query images.

    Returns:
        x, y in metres and heading in radians (-π..π).
    """
    rng = stream(seed, "pose", session, index)
    stretch = min(LENGTH, SPACING * maps)
    step = stretch / maps
    if session == "map":
        s, side, yaw = index * step, rng.uniform(-0.1, 0.1), rng.normal(0, 0.2 * YAW)
    else:
        # The middle half between two neighbouring map positions.
        nearest = np.floor((index + 0.5) / queries * maps)
        s = (nearest + rng.uniform(0.25, 0.75)) * step
        side, yaw = rng.uniform(-SHIFT, SHIFT), np.clip(rng.normal(0, YAW), -2.5 * YAW, 2.5 * YAW)
    heading = float(route.heading(s))
    x, y = route.at(s) + side * np.array([-np.sin(heading), np.cos(heading)])
    return float(x), float(y), float((heading + yaw + np.pi) % (2 * np.pi) - np.pi)
