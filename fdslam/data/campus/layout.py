"""What stands where: buildings along the path, a road across it, trees, and the things between them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus.facade import Style, style
from fdslam.data.campus.route import LENGTH, Route
from fdslam.data.campus.scene import corners, turn
from fdslam.data.campus.seeds import stream

CLEAR = 2.2  # metres on either side of the path where nothing of the map stands
ROAD = 3.2  # metres: half the road's width
GAP = 2.5  # metres between buildings


@dataclass(frozen=True)
class Building:
    """An upright block."""

    center: NDArray[np.float64]  # [2] metres
    size: tuple[float, float]  # metres along and across its angle
    angle: float  # radians
    storeys: int
    style: Style
    gabled: bool

    @property
    def height(self) -> float:
        """Metres to the eaves."""
        return self.storeys * self.style.storey

    @property
    def feet(self) -> NDArray[np.float64]:
        """Ground corners [4, 2]; consecutive pairs are the faces, left to right from outside."""
        return corners(self.center, self.size, self.angle)

    @property
    def reach(self) -> float:
        """Metres from the centre to a corner."""
        return math.hypot(*self.size) / 2

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance [n] of ground points [n, 2] from the footprint, 0 inside."""
        q = np.abs((points - self.center) @ turn(self.angle)) - np.array(self.size) / 2
        d: NDArray[np.float64] = np.linalg.norm(np.maximum(q, 0), axis=1)
        return d


@dataclass(frozen=True)
class Thing:
    """Something small that stands on the ground."""

    kind: str  # tree, bush, lamp, sign, bench, bicycle, bin, bollard, car or hedge
    at: NDArray[np.float64]  # [2] metres
    angle: float  # radians
    size: float  # metres: a tree's or lamp's height, a hedge's length
    look: int  # which of the textures of its kind


RADIUS = {
    "tree": 0.5, "bush": 0.8, "lamp": 0.6, "sign": 0.6, "bench": 1.0, "bicycle": 0.9, "bin": 0.5, "bollard": 0.2,
    "car": 2.3, "hedge": 2.6,
}  # fmt: skip  # metres that nothing else may come near


@dataclass(frozen=True)
class Layout:
    """The campus without its textures."""

    buildings: tuple[Building, ...]
    things: tuple[Thing, ...]
    road: float  # y of the road's middle line, metres: it runs from west to east

    def free(self, at: NDArray[np.float64], radius: float) -> bool:
        """Say whether a disc stands clear of everything on the ground."""
        if any(math.dist(t.at, at) <= radius + RADIUS[t.kind] for t in self.things):
            return False
        margin = radius + 0.2
        near = (b for b in self.buildings if math.dist(b.center, at) < b.reach + margin)
        return all(b.distance(at[None])[0] >= margin for b in near)


def _outline(b: Building) -> NDArray[np.float64]:
    """Return points [n, 2] all over the footprint, about every 2 m."""
    u, v = (np.linspace(-0.5, 0.5, max(2, round(n / 2) + 1)) * n for n in b.size)
    grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    return b.center + grid @ turn(b.angle).T


def _buildings(rng: np.random.Generator, way: Route, road: float) -> list[Building]:
    """Line the path with buildings, then fill the distance with more."""
    built: list[Building] = []
    path = way.points[::4]

    def attempt(center: NDArray[np.float64], size: tuple[float, float], angle: float, clearance: float) -> None:
        b = Building(center, size, angle, int(rng.integers(2, 5)), style(rng), bool(rng.random() < 0.4))
        if abs(center[1] - road) < ROAD + 3 or b.distance(path).min() < clearance:
            return
        points = _outline(b)
        if np.abs(points[:, 1] - road).min() < ROAD + 3 or np.abs(points).max() > 62:
            return
        near = (o for o in built if math.dist(o.center, center) < o.reach + b.reach + GAP)
        if any(min(o.distance(points).min(), b.distance(_outline(o)).min()) < GAP for o in near):
            return
        built.append(b)

    for s in np.arange(0, LENGTH, 2.0):
        for side in (-1, 1):
            heading = float(way.heading(s)) + rng.normal(0, 0.07)
            size = (rng.uniform(7, 18), rng.uniform(6, 11))
            away = side * (rng.uniform(4.3, 7.5) + size[1] / 2)
            attempt(way.at(s) + away * turn(heading)[:, 1], size, heading, 4.2)
    for _ in range(240):
        attempt(rng.uniform(-58, 58, 2), (rng.uniform(10, 22), rng.uniform(8, 14)), rng.uniform(0, np.pi), 7.0)
    return built


def layout(seed: int, way: Route) -> Layout:
    """Lay out the campus.

    Args:
        seed: the world's seed.
        way: the path; nothing stands within CLEAR metres of it.
    """
    rng = stream(seed, "layout")
    road = float(rng.uniform(-6, 6))
    plan = Layout(tuple(_buildings(rng, way, road)), (), road)

    def add(kind: str, at: NDArray[np.float64], angle: float, size: float, clearance: float, looks: int = 4) -> None:
        nonlocal plan
        thing = Thing(kind, at, angle, size, int(rng.integers(looks)))
        margin = {"tree": 1.6, "hedge": -1.2, "sign": -0.2, "bicycle": -0.3}.get(kind, 0.0)
        if way.distance(at[None])[0] < clearance or not plan.free(at, RADIUS[kind] + margin):
            return
        if kind not in ("car", "lamp") and abs(at[1] - road) < ROAD + 0.8:
            return
        plan = Layout(plan.buildings, (*plan.things, thing), road)

    def beside(s: float, side: float, kind: str, face: float, size: float = 1.0, looks: int = 4) -> None:
        heading = float(way.heading(s))
        at = way.at(s) + side * turn(heading)[:, 1]
        add(kind, at, heading + face, size, abs(side) - 0.4, looks)

    for k, s in enumerate(np.arange(3.0, LENGTH, 15.0)):
        beside(s, 2.7 * (-1) ** k, "lamp", np.pi / 2 * (1 if k % 2 else -1), rng.uniform(3.8, 4.6))
    for x in np.arange(-58, 58, 5.4):
        for lane in (-1, 1):
            if rng.random() < 0.45:
                at = np.array([x + rng.uniform(-0.4, 0.4), road + lane * 2.2])
                add("car", at, 0 if lane < 0 else np.pi, 1, 4.5, 7)
    for s in np.arange(0, LENGTH, 3.2):
        side = float(rng.choice([-1, 1]) * rng.uniform(2.8, 4.2))
        kind = str(rng.choice(["bench", "bicycle", "bin", "sign", "hedge", "bush", "bollard", "bicycle", "bush"]))
        face = {"bench": -np.pi / 2 * np.sign(side), "sign": np.pi + rng.normal(0, 0.3)}.get(kind, rng.normal(0, 0.2))
        length = rng.uniform(3, 5) if kind == "hedge" else rng.uniform(0.8, 1.3)
        beside(s + rng.uniform(-1, 1), side, kind, float(face), length, 7 if kind == "bicycle" else 4)
    for _ in range(230):
        s, side = rng.uniform(0, LENGTH), rng.choice([-1, 1]) * rng.uniform(3.2, 12)
        beside(float(s), float(side), "tree", float(rng.uniform(0, np.pi)), float(rng.uniform(5, 9)))
    for a in np.arange(0, 2 * np.pi, 0.075):
        at = rng.uniform(64, 72) * np.array([np.cos(a), np.sin(a)])
        add("tree", at, float(a), float(rng.uniform(8, 13)), 3.0)
    return plan
