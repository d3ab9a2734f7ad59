"""What stands in some sessions and not in others: the objects whose appearance is an annotated change.

An object keeps its place for a whole session, so every image of the session that looks there shows it. It is a change
of a query session against a map session where it stands in the first and not in the second.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus import guises, machines, props
from fdslam.data.campus.camera import Camera
from fdslam.data.campus.layout import EDGE, Layout
from fdslam.data.campus.passage import indoors
from fdslam.data.campus.route import LENGTH, Route, sideways
from fdslam.data.campus.scene import OBJECT, Quad, box, plate, turn, wall
from fdslam.data.campus.seasons import SESSIONS
from fdslam.data.campus.seeds import stream
from fdslam.data.campus.texture import Texture, plain, shift

KINDS = ("car", "person", "construction", "machine", "poster", "table", "board")
_OUTDOORS = (0.19, 0.26, 0.15, 0.13, 0.15, 0.06, 0.06)  # how often each kind is drawn
_INDOORS = (0.0, 0.25, 0.14, 0.0, 0.23, 0.19, 0.19)
ZONE = 8.0  # metres of the path over which a cluster of objects spreads, about
# Objects stand in clusters along the path, and each session knows those of some stretches, so that a robot also sees
# stretches without change. In the order of the path: in which of the four sessions, shuffled, objects may stand.
_LIVELY = ("ADB", "AC", "AC", "ABC", "BD", "BD", "BCD", "AC", "AC", "CDA", "BD", "BD")
SEEN = (8.0, 32.0)  # metres of the path from which an object can be seen: else it is useless, or in too many images
FARTHEST = 18.0  # metres from the path to a wall on which something hangs
TRIES = 60  # places tried for an object
PASS = 0.6  # metres between an object and a robot that passes it
Point = NDArray[np.float64]  # [2] metres


@dataclass(frozen=True)
class Item:
    """An object at its place."""

    kind: str  # one of KINDS
    quads: tuple[Quad, ...]
    at: Point  # [2] metres
    radius: float  # metres that nothing else may come near; 0: it hangs or leans on a wall
    turns: bool  # a person, who is always seen from the front
    sessions: frozenset[str]  # in which it stands

    def seen_from(self, camera: Camera) -> list[Quad]:
        """Return its quads as they stand before a camera."""
        if not self.turns:
            return list(self.quads)
        dx, dy = camera.position[:2] - self.at
        axes = np.eye(3)
        axes[:2, :2] = turn(float(np.arctan2(dy, dx)))
        foot = np.array([*self.at, 0.0])
        return [replace(q, origin=foot + axes @ q.origin, right=axes @ q.right) for q in self.quads]


def _person(rng: np.random.Generator, _at: Point, _toward: float) -> list[Quad]:
    """Return a person at the origin who looks along +x: ``Item.seen_from`` turns and moves them."""
    image, tall = guises.person(rng), rng.uniform(1.55, 1.92)
    half = np.array([0.0, tall * 0.22])
    return wall(-half, half, 0, tall, Texture(lambda: image), OBJECT, two_sided=True, lit=False)


def _board(rng: np.random.Generator, at: Point, toward: float) -> list[Quad]:
    """Return a whiteboard on wheels."""
    image, wide = guises.board(rng), rng.uniform(1.1, 1.7)
    half = turn(toward)[:, 1] * wide / 2
    return wall(at - half, at + half, 0, wide * 1.19, Texture(lambda: image), OBJECT, two_sided=True)


def _table(rng: np.random.Generator, at: Point, toward: float) -> list[Quad]:
    """Return a table with things on it."""
    color = guises.SKIN[rng.integers(4)]
    legs, top = Texture(lambda: guises.table_front(shift(color, -0.4))), guises.table_top(rng)
    size, across = (rng.uniform(1.2, 1.9), rng.uniform(0.7, 0.95)), toward + np.pi / 2
    quads = [replace(q, two_sided=True) for q in box(at, size, across, 0, 0.74, legs, None, OBJECT)]
    quads.append(plate(at, (size[0] + 0.1, size[1] + 0.1), across, 0.745, Texture(lambda: top), OBJECT))
    for _ in range(int(rng.integers(1, 4))):
        spot = at + turn(across) @ (rng.uniform(-0.35, 0.35, 2) * size)
        side = plain(guises.color(rng))
        wide, deep, tall = rng.uniform((0.12, 0.12, 0.08), 0.4)
        quads += box(spot, (wide, deep), across, 0.745, 0.75 + tall, side, side, OBJECT)
    return quads


def _car(rng: np.random.Generator, at: Point, toward: float) -> list[Quad]:
    color = shift(props.PAINTS[rng.integers(len(props.PAINTS))], rng.uniform(-0.2, 0.2))
    return props.car(at, toward + rng.uniform(-np.pi, np.pi), props.car_textures(color))


Maker = Callable[[np.random.Generator, Point, float], list[Quad]]  # from the direction to the viewer, radians
# Per kind what may be built, the last of them indoors, and its radius in metres.
_STANDING: dict[str, tuple[tuple[Maker, float], ...]] = {
    "car": ((_car, 2.1),),
    "person": ((_person, 0.35),),
    "construction": ((machines.site, 2.1), (machines.barrier, 0.9)),
    "machine": ((machines.excavator, 2.3), (machines.roller, 1.8), (machines.dumper, 1.6)),
    "table": ((_table, 0.9),),
    "board": ((_board, 0.75),),
}


class Placer:
    """Places objects one by one, each where there is room for it in its sessions."""

    def __init__(self, plan: Layout, way: Route, seed: int) -> None:
        self.plan, self.way = plan, way
        along = np.arange(0, LENGTH, 0.5)
        self.walks = {name: way.beside(along, sideways(seed, name, along)) for name in SESSIONS}
        self.placed: list[Item] = []
        stops = np.arange(0, LENGTH, 2.0)
        self.stops, self.headings = way.at(stops), way.heading(stops)
        grid = np.arange(-EDGE, EDGE + 1)
        points = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
        built = np.zeros(len(points), bool)
        for k, b in enumerate(plan.buildings):
            built |= (b.distance(points) == 0) & ~((k == 0) & plan.passage.inside(points))
        self.built = built.reshape(len(grid), len(grid))  # [y, x] every metre from -EDGE: a building stands there
        sides = [(f, g, b.height) for b in plan.buildings for f, g in zip(b.feet, np.roll(b.feet, -1, 0), strict=True)]
        self.faces = np.array([[*f, *g, height] for f, g, height in sides])  # [n, 5] left foot, right foot, height

    def fits(self, at: Point, radius: float, sessions: frozenset[str]) -> bool:
        """Say whether a disc is free of the campus, of other objects and of the robot's way in these sessions."""
        if not self.plan.free(at, radius):
            return False
        if any(np.linalg.norm(self.walks[name] - at, axis=1).min() < radius + PASS for name in sessions):
            return False
        together = (o for o in self.placed if o.radius and o.sessions & sessions)
        return all(np.hypot(*(o.at - at)) > 0.8 * (radius + o.radius) for o in together)

    def seen_along(self, at: Point) -> float:
        """Return from how many metres of the path a place can be seen: ahead, and with no building in between."""
        eye, heading = self.stops, self.headings
        away = at - eye
        ahead = np.abs((np.arctan2(away[:, 1], away[:, 0]) - heading + np.pi) % (2 * np.pi) - np.pi) < 0.5
        eye, away = eye[ahead], away[ahead]
        steps = np.linspace(0, 0.97, 24)[:, None]
        between = eye[:, None] + away[:, None] * steps  # [n, 24, 2]
        column, row = np.rint(between + EDGE).astype(int).clip(0, len(self.built) - 1).transpose(2, 0, 1)
        return 2.0 * np.count_nonzero(~self.built[row, column].any(1))

    def stand(self, rng: np.random.Generator, kind: str, s: float, sessions: frozenset[str]) -> Item | None:
        """Draw an object that stands on the ground near the path at ``s`` metres, if there is room."""
        heading = float(self.way.heading(s))
        inside = bool(self.plan.passage.inside(self.way.at(s)))
        choices = _STANDING[kind]
        make, radius = choices[-1] if inside else choices[rng.integers(len(choices))]
        reach = self.plan.passage.half - radius - 0.25 if inside else 2.5 + radius + 2.0
        at = self.way.beside(s, float(rng.choice([-1, 1]) * reach * rng.uniform(0.25, 1)))
        if not self.fits(at, radius, sessions) or bool(self.plan.passage.inside(at)) != inside:
            return None
        toward = heading + np.pi + rng.uniform(-0.5, 0.5)
        quads = make(rng, at, toward)
        return Item(kind, tuple(indoors(quads) if inside else quads), at, radius, kind == "person", sessions)

    def _wall(self, s: float, azimuth: float) -> tuple[Point, Point, float, float] | None:
        """Return the wall that a ray from the path meets first: its feet, where between them (0..1), its height."""
        eye, ray, p = self.way.at(s), turn(azimuth)[:, 0], self.plan.passage
        faces = self.faces
        if p.inside(eye):
            north, south = p.middle + p.half, p.middle - p.half
            faces = np.array([[p.west, north, p.east, north, p.height], [p.east, south, p.west, south, p.height]])
        feet, along = faces[:, :2] - eye, faces[:, 2:4] - faces[:, :2]
        cross = ray[0] * along[:, 1] - ray[1] * along[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (feet[:, 0] * along[:, 1] - feet[:, 1] * along[:, 0]) / cross
            u = (feet[:, 0] * ray[1] - feet[:, 1] * ray[0]) / cross
            t[~((t > 0) & (t < FARTHEST) & (u >= 0) & (u <= 1))] = np.inf
        k = int(np.argmin(t))
        return None if np.isinf(t[k]) else (faces[k, :2], faces[k, 2:4], float(u[k]), float(faces[k, 4]))

    def hang(self, rng: np.random.Generator, kind: str, s: float, sessions: frozenset[str]) -> Item | None:
        """Draw a poster, or a building site at a wall, beside the path at ``s`` metres, if there is a wall."""
        azimuth = float(self.way.heading(s)) + float(rng.choice([-1, 1]) * rng.uniform(0.35, 1.4))
        found = self._wall(s, azimuth)
        if found is None:
            return None
        a, c, u, height = found
        length, inside = float(np.hypot(*(c - a))), bool(self.plan.passage.inside(self.way.at(s)))
        along = (c - a) / length
        out = np.array([along[1], -along[0]])
        small, large = (0.45, 1.3) if inside else (0.6, 2.6)
        wide = float(np.exp(rng.uniform(np.log(small), np.log(large))))
        if kind == "construction":
            wide = min(rng.uniform(1.8, 3.2) if inside else rng.uniform(3.5, 8.0), length - 0.6)
        left = float(np.clip(u * length - wide / 2, 0.2, length - wide - 0.2))
        start, stop = a + along * left, a + along * (left + wide)
        away = [np.hypot(*(o.at - (start + stop) / 2)) > 0.6 * wide + 0.8 for o in self.placed if not o.radius]
        if not all(away) or (not inside and self.plan.passage.inside((start + stop) / 2, -0.5)):
            return None
        if kind == "poster":
            tall = min(wide * rng.uniform(1.2, 1.5), 0.8 * height)
            low = float(rng.uniform(0.6, max(0.7, min(1.8, height - tall - 0.15))))
            image = guises.poster(rng)
            quads = wall(start + 0.04 * out, stop + 0.04 * out, low, low + tall, Texture(lambda: image), OBJECT)
        elif inside:
            quads = machines.partition(rng, start + 0.3 * out, stop + 0.3 * out)
        else:
            feet = np.linspace(start, stop, 5) + 0.5 * out
            if any(np.hypot(*(t.at - foot)) < 1.2 for t in self.plan.things for foot in feet):
                return None
            quads = machines.scaffold(rng, start, stop, out, min(height, float(rng.uniform(3.9, 8.2))))
        return Item(
            kind, tuple(indoors(quads) if inside else quads), (start + stop) / 2 + 0.3 * out, 0.0, False, sessions
        )


def _sessions(rng: np.random.Generator, kind: str, lively: list[str], placed: list[Item]) -> frozenset[str]:
    """Draw the sessions in which an object stands: the one that has the fewest so far and, but for a person, others."""
    crowd = [sum(name in item.sessions for item in placed) for name in lively]
    others = sorted(lively)
    first = others.pop(others.index(lively[int(np.argmin(crowd))]))
    more = 0 if kind == "person" else min(len(others), int(rng.choice([0, 1, 2], p=(0.5, 0.3, 0.2))))
    return frozenset([first, *rng.choice(others, more, replace=False).tolist()])


def furnish(plan: Layout, way: Route, seed: int) -> tuple[Item, ...]:
    """Return all objects that stand in some sessions and not in others."""
    rng = stream(seed, "clusters")
    placer = Placer(plan, way, seed)
    step = LENGTH / len(_LIVELY)
    name = dict(zip("ABCD", rng.permutation(SESSIONS).tolist(), strict=True))
    start = int(rng.integers(len(_LIVELY)))
    for cluster in range(len(_LIVELY)):
        lively = [name[letter] for letter in _LIVELY[(cluster + start) % len(_LIVELY)]]
        middle = (cluster + rng.uniform(0.3, 0.7)) * step
        for _ in range(int(rng.integers(5, 8))):
            s = float(middle + rng.uniform(-ZONE / 2, ZONE / 2))
            kind = str(rng.choice(KINDS, p=_INDOORS if plan.passage.inside(way.at(s)) else _OUTDOORS))
            sessions = _sessions(rng, kind, lively, placer.placed)
            hangs = kind == "poster" or (kind == "construction" and rng.random() < 0.45)
            place = placer.hang if hangs else placer.stand
            tries = (place(rng, kind, s + rng.uniform(-ZONE / 2, ZONE / 2), sessions) for _ in range(TRIES))
            item = next(
                (found for found in tries if found is not None and SEEN[0] <= placer.seen_along(found.at) <= SEEN[1]),
                None,
            )
            if item is not None:
                placer.placed.append(item)
    return tuple(placer.placed)
