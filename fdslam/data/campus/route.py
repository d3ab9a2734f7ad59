"""The path through the campus, and where each session walks on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus.seeds import stream

LENGTH = 240.0  # metres around the loop
SPACING = 2.5  # metres between the images of a session, at most
STRAIGHT = 36.0  # metres: the path's two straight stretches; the first leads through a building
APPROACH = 12.0  # metres from where the path begins to its first straight stretch
SHIFT = 1.5  # metres: farthest that a session walks beside the path
YAW = np.deg2rad(3.0)  # standard deviation of an image's heading about the direction of travel


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

    def beside(self, s: float | NDArray[np.float64], side: float | NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the points [..., 2] at ``s`` metres along the path and ``side`` metres to its left."""
        heading = self.heading(s)
        return self.at(s) + np.asarray(side)[..., None] * np.stack([-np.sin(heading), np.cos(heading)], axis=-1)

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance [n] of points [n, 2] from the path, metres."""
        d: NDArray[np.float64] = np.linalg.norm(points[:, None] - self.points[::2], axis=2).min(1)
        return d


def route(seed: int) -> Route:
    """Return the campus's path: a loop of LENGTH metres, bent by the seed, with two straight stretches west to east.

    It begins APPROACH metres before the southern one, which runs east at the middle of the world.
    """
    rng = stream(seed, "route")
    angle = np.linspace(0, 2 * np.pi, 4000, endpoint=False)
    a, b = rng.uniform(0, 2 * np.pi, 2)
    radius = 1 + rng.uniform(0.06, 0.1) * np.cos(2 * angle + a) + rng.uniform(0.05, 0.08) * np.cos(3 * angle + b)
    xy = np.stack([1.15 * radius * np.cos(angle), 0.95 * radius * np.sin(angle)], axis=1)
    around = np.linalg.norm(np.diff(xy, axis=0, append=xy[:1]), axis=1).sum()
    xy *= (LENGTH - 2 * STRAIGHT) / around
    south, north = int(xy[:, 1].argmin()), int(xy[:, 1].argmax())
    xy = np.roll(xy, -south, axis=0)
    half = (north - south) % len(xy)
    # At its southernmost and northernmost points the loop runs level: pulled apart there, it stays smooth.
    east, west = xy[: half + 1] - xy[0], xy[half:] - xy[0]
    east[:, 0] += STRAIGHT
    loop = np.concatenate([[[0.0, 0.0]], east, west])
    loop -= [STRAIGHT / 2, (loop[:, 1].min() + loop[:, 1].max()) / 2]
    closed = np.concatenate([loop, loop[:1]])
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    even = (np.linspace(0, LENGTH, int(LENGTH * 4), endpoint=False) - APPROACH) % LENGTH / LENGTH * along[-1]
    return Route(np.stack([np.interp(even, along, closed[:, k]) for k in (0, 1)], axis=1))


def sideways(seed: int, session: str, s: float | NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far to the left of the path a session walks at ``s`` metres along it, [...] within ± SHIFT."""
    rng = stream(seed, "walk", session)
    waves = np.array([1, 2, 5, 9])  # whole waves around the loop: it ends where it began
    phase, height = rng.uniform(0, 2 * np.pi, 4), rng.uniform(0.3, 0.9, 4)
    swing = np.cos(np.asarray(s, float)[..., None] / LENGTH * 2 * np.pi * waves + phase) * height
    return 0.9 * SHIFT * np.tanh(swing.sum(-1))


def pose(way: Route, seed: int, session: str, index: int, images: int) -> tuple[float, float, float]:
    """Return where an image is taken.

    The images of a session stand every SPACING metres or closer, so that they go around the loop once if there are
    enough of them. Each session has a path of its own, and each image jitters about it.

    Args:
        way: the path.
        seed: the world's seed.
        session: which.
        index: of the image in its session.
        images: of the session.

    Returns:
        x, y in metres and heading in radians (-π..π).
    """
    rng = stream(seed, "pose", session, index)
    step = min(LENGTH, SPACING * images) / images
    offset = stream(seed, "start", session).uniform(0, 1)
    s = (index + offset + rng.uniform(-0.25, 0.25)) * step
    side = float(np.clip(sideways(seed, session, s) + rng.uniform(-0.15, 0.15), -SHIFT, SHIFT))
    ahead = way.beside(s + 0.5, sideways(seed, session, s + 0.5)) - way.beside(
        s - 0.5, sideways(seed, session, s - 0.5)
    )
    heading = float(np.arctan2(ahead[1], ahead[0])) + float(np.clip(rng.normal(0, YAW), -2.5 * YAW, 2.5 * YAW))
    x, y = way.beside(s, side)
    return float(x), float(y), float((heading + np.pi) % (2 * np.pi) - np.pi)
