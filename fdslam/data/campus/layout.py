"""What stands where: buildings along the path and one that it leads through, a road, trees, and things between them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus.facade import Style, style
from fdslam.data.campus.route import LENGTH, STRAIGHT, Route
from fdslam.data.campus.scene import corners, turn
from fdslam.data.campus.seeds import stream

CLEAR = 2.2  # metres on either side of the path where nothing of the map stands
ROAD = 3.2  # metres: half the road's width
GAP = 2.5  # metres between buildings
EDGE = 68.0  # metres: no building reaches farther east, north, west or south


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
class Passage:
    """The corridor through the first building, level with the ground, along the path from west to east."""

    west: float  # x of its western end, metres
    east: float
    middle: float  # y of its middle line, metres
    half: float = 2.5  # metres: half its width
    height: float = 3.0  # metres

    def inside(self, points: NDArray[np.float64], margin: float = 0.0) -> NDArray[np.bool_]:
        """Tell which ground points [..., 2] lie in it, ``margin`` metres from its walls and ends."""
        x, y = points[..., 0], points[..., 1]
        within: NDArray[np.bool_] = (x >= self.west + margin) & (x <= self.east - margin)
        return within & (np.abs(y - self.middle) <= self.half - margin)


@dataclass(frozen=True)
class Thing:
    """Something small that stands on the ground."""

    kind: str  # tree, bush, lamp, sign, bench, bicycle, bin, bollard, car, hedge or locker
    at: NDArray[np.float64]  # [2] metres
    angle: float  # radians
    size: float  # metres: a tree's or lamp's height, a hedge's or locker's length
    look: int  # which of the textures of its kind
    number: int  # of the thing, the same in every session


RADIUS = {
    "tree": 0.5, "bush": 0.8, "lamp": 0.6, "sign": 0.6, "bench": 1.0, "bicycle": 0.9, "bin": 0.5, "bollard": 0.2,
    "car": 2.3, "hedge": 2.6, "locker": 1.2,
}  # fmt: skip  # metres that nothing else may come near


@dataclass(frozen=True)
class Layout:
    """The campus without its textures."""

    buildings: tuple[Building, ...]  # the first is the one with the passage
    passage: Passage
    things: tuple[Thing, ...]
    road: float  # y of the road's middle line, metres: it runs from west to east

    def free(self, at: NDArray[np.float64], radius: float) -> bool:
        """Say whether a disc stands clear of everything on the ground."""
        if any(math.dist(t.at, at) <= radius + RADIUS[t.kind] for t in self.things):
            return False
        margin = radius + 0.2
        around = self.buildings[1:] if self.passage.inside(at, margin) else self.buildings
        near = (b for b in around if math.dist(b.center, at) < b.reach + margin)
        return all(b.distance(at[None])[0] >= margin for b in near)


def _outline(b: Building) -> NDArray[np.float64]:
    """Return points [n, 2] all over the footprint, about every 2 m."""
    u, v = (np.linspace(-0.5, 0.5, max(2, round(n / 2) + 1)) * n for n in b.size)
    grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    return b.center + grid @ turn(b.angle).T


def _hall(rng: np.random.Generator, way: Route) -> tuple[Building, Passage]:
    """Set a building across the path's first straight stretch, with a passage for it."""
    middle = float(way.points[:, 1].min())
    length = STRAIGHT - 6.0
    st = replace(style(rng), storey=3.5, arched=False, banded=True)
    return Building(np.array([0.0, middle]), (length, 13.0), 0.0, 3, st, False), Passage(
        -length / 2, length / 2, middle
    )


def _buildings(rng: np.random.Generator, way: Route, road: float, hall: Building) -> list[Building]:
    """Line the path with buildings, then fill the distance with more."""
    built = [hall]
    path = way.points[::4]

    def attempt(center: NDArray[np.float64], size: tuple[float, float], angle: float, clearance: float) -> None:
        b = Building(center, size, angle, int(rng.integers(2, 5)), style(rng), bool(rng.random() < 0.4))
        if abs(center[1] - road) < ROAD + 3 or b.distance(path).min() < clearance:
            return
        points = _outline(b)
        if np.abs(points[:, 1] - road).min() < ROAD + 3 or np.abs(points).max() > EDGE:
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
    for _ in range(300):
        attempt(
            rng.uniform(4 - EDGE, EDGE - 4, 2), (rng.uniform(10, 22), rng.uniform(8, 14)), rng.uniform(0, np.pi), 7.0
        )
    return built


def _lockers(rng: np.random.Generator, p: Passage) -> tuple[Thing, ...]:
    """Stand lockers along the walls of the passage."""
    lockers = []
    for k, x in enumerate(np.arange(p.west + 4.5, p.east - 3.5, 5.5)):
        wall = int(rng.choice([-1, 1]))
        at = np.array([x + rng.uniform(-0.8, 0.8), p.middle + wall * (p.half - 0.24)])
        lockers.append(Thing("locker", at, 0.0, float(rng.choice([1.2, 1.6, 2.0])), int(rng.integers(4)), k))
    return tuple(lockers)


def layout(seed: int, way: Route) -> Layout:
    """Lay out the campus.

    Args:
        seed: the world's seed.
        way: the path; nothing stands within CLEAR metres of it.
    """
    rng = stream(seed, "layout")
    road = float(rng.uniform(-6, 6))
    hall, passage = _hall(rng, way)
    plan = Layout(tuple(_buildings(rng, way, road, hall)), passage, _lockers(rng, passage), road)

    def add(kind: str, at: NDArray[np.float64], angle: float, size: float, clearance: float, looks: int = 4) -> None:
        nonlocal plan
        thing = Thing(kind, at, angle, size, int(rng.integers(looks)), len(plan.things))
        margin = {"tree": 1.6, "hedge": -1.2, "sign": -0.2, "bicycle": -0.3}.get(kind, 0.0)
        if way.distance(at[None])[0] < clearance or not plan.free(at, RADIUS[kind] + margin):
            return
        if kind not in ("car", "lamp") and abs(at[1] - road) < ROAD + 0.8:
            return
        plan = replace(plan, things=(*plan.things, thing))

    def beside(s: float, side: float, kind: str, face: float, size: float = 1.0, looks: int = 4) -> None:
        heading = float(way.heading(s))
        at = way.at(s) + side * turn(heading)[:, 1]
        add(kind, at, heading + face, size, abs(side) - 0.4, looks)

    for k, s in enumerate(np.arange(3.0, LENGTH, 15.0)):
        beside(s, 2.7 * (-1) ** k, "lamp", np.pi / 2 * (1 if k % 2 else -1), rng.uniform(3.8, 4.6))
    for x in np.arange(4 - EDGE, EDGE - 4, 5.4):
        for lane in (-1, 1):
            if rng.random() < 0.6:
                at = np.array([x + rng.uniform(-0.4, 0.4), road + lane * 2.2])
                add("car", at, 0 if lane < 0 else np.pi, 1, 4.5, 7)
    for s in np.arange(0, LENGTH, 3.2):
        side = float(rng.choice([-1, 1]) * rng.uniform(2.8, 4.2))
        kind = str(rng.choice(["bench", "bicycle", "bin", "sign", "hedge", "bush", "bollard", "bicycle", "bush"]))
        face = {"bench": -np.pi / 2 * np.sign(side), "sign": np.pi + rng.normal(0, 0.3)}.get(kind, rng.normal(0, 0.2))
        length = rng.uniform(3, 5) if kind == "hedge" else rng.uniform(0.8, 1.3)
        beside(s + rng.uniform(-1, 1), side, kind, float(face), length, 7 if kind == "bicycle" else 4)
    for _ in range(280):
        s, side = rng.uniform(0, LENGTH), rng.choice([-1, 1]) * rng.uniform(3.2, 12)
        beside(float(s), float(side), "tree", float(rng.uniform(0, np.pi)), float(rng.uniform(5, 9)))
    for a in np.arange(0, 2 * np.pi, 0.07):
        at = rng.uniform(EDGE + 3, EDGE + 10) * np.array([np.cos(a), np.sin(a)])
        add("tree", at, float(a), float(rng.uniform(8, 13)), 3.0)
    return plan


def moved(plan: Layout, seed: int, session: str) -> tuple[Thing, ...]:
    """Return the things as they stand in a session: nobody annotates which bicycles and parked cars have moved."""
    things: list[Thing] = []
    for i, t in enumerate(plan.things):
        rng = stream(seed, "moved", session, i)
        if t.kind in ("car", "bicycle"):
            if rng.random() < 0.35:
                continue
            along = turn(t.angle)[:, 0] * rng.uniform(-0.35, 0.35)
            turned = t.angle + (rng.normal(0, 0.25) if t.kind == "bicycle" else 0.0)
            t = replace(t, at=t.at + along, angle=turned, look=int(rng.integers(7)))
        elif t.kind == "bin":
            t = replace(t, at=t.at + rng.uniform(-0.15, 0.15, 2), angle=t.angle + rng.normal(0, 0.2))
        things.append(t)
    return tuple(things)
