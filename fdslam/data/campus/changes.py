"""Change objects: what they are made of and where a query meets them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus import guises, props
from fdslam.data.campus.camera import Camera
from fdslam.data.campus.layout import Layout
from fdslam.data.campus.scene import OBJECT, Quad, box, plate, turn, wall
from fdslam.data.campus.texture import Texture, plain, shift

KINDS = ("car", "person", "barrier", "poster", "table", "board")
RADIUS = {"car": 1.9, "person": 0.4, "barrier": 0.9, "poster": 0.0, "table": 0.9, "board": 0.7}  # metres
_SHARE = (0.2, 0.24, 0.12, 0.18, 0.13, 0.13)  # how often each kind is met
NEAREST, FARTHEST = 2.8, 26.0  # metres ahead


@dataclass(frozen=True)
class Change:
    """An object that the map session has not seen."""

    kind: str  # one of KINDS
    quads: tuple[Quad, ...]
    at: NDArray[np.float64]  # [2] metres
    shade: float  # radius of the dark patch under it, metres; 0: none


def _standing(rng: np.random.Generator, kind: str, at: NDArray[np.float64], toward: float) -> list[Quad]:
    """Return an object that stands on the ground at ``at``; ``toward`` is the direction to the viewer, radians."""
    if kind == "car":
        color = props.PAINTS[rng.integers(len(props.PAINTS))]
        return props.car(at, rng.uniform(-np.pi, np.pi), props.car_textures(shift(color, rng.uniform(-0.2, 0.2))))
    angle = toward + rng.uniform(-0.5, 0.5)
    # ``right`` is to the viewer's right along the object.
    right = turn(angle)[:, 1]
    if kind == "person":
        image, tall = guises.person(rng), rng.uniform(1.55, 1.92)
        half = turn(toward)[:, 1] * tall * 0.22
        return wall(at - half, at + half, 0, tall, Texture(lambda: image), OBJECT, two_sided=True, lit=False)
    if kind == "barrier":
        image, wide = guises.barrier(rng), rng.uniform(1.4, 2.2)
        half = right * wide / 2
        return wall(at - half, at + half, 0, 0.5 * wide, Texture(lambda: image), OBJECT, two_sided=True)
    if kind == "board":
        image, wide = guises.board(rng), rng.uniform(1.1, 1.7)
        half = right * wide / 2
        return wall(at - half, at + half, 0, wide * 1.19, Texture(lambda: image), OBJECT, two_sided=True)
    color = guises.SKIN[rng.integers(4)]
    legs, top = Texture(lambda: guises.table_front(shift(color, -0.4))), guises.table_top(rng)
    size = rng.uniform(1.2, 1.9), rng.uniform(0.7, 0.95)
    across = angle + np.pi / 2
    quads = box(at, size, across, 0, 0.74, legs, None, OBJECT)
    quads = [Quad(q.origin, q.right, q.down, q.texture, q.label, two_sided=True) for q in quads]
    quads.append(plate(at, (size[0] + 0.1, size[1] + 0.1), across, 0.745, Texture(lambda: top), OBJECT))
    for _ in range(int(rng.integers(1, 4))):
        spot = at + turn(across) @ (rng.uniform(-0.35, 0.35, 2) * size)
        side = plain(guises.color(rng))
        wide, deep, tall = rng.uniform((0.12, 0.12, 0.08), 0.4)
        quads += box(spot, (wide, deep), across, 0.745, 0.75 + tall, side, side, OBJECT)
    return quads


def _poster(rng: np.random.Generator, plan: Layout, camera: Camera) -> Change | None:
    """Hang a poster on the facade that a random ray from the camera meets first, if any is near enough."""
    azimuth = camera.heading + rng.uniform(-0.5, 0.5)
    ray, eye = turn(azimuth)[:, 0], camera.position[:2]
    best, face = FARTHEST, None
    for b in plan.buildings:
        for a, c in zip(b.feet, np.roll(b.feet, -1, axis=0), strict=True):
            system = np.stack([ray, a - c], axis=1)
            if abs(np.linalg.det(system)) < 1e-9:
                continue
            t, u = np.linalg.solve(system, a - eye)
            if 0 < t < best and 0 <= u <= 1:
                best, face = float(t), (a, c, float(u), b.height)
    if face is None:
        return None
    a, c, u, height = face
    length = float(np.hypot(*(c - a)))
    along = (c - a) / length
    wide = float(np.exp(rng.uniform(np.log(0.5), np.log(2.4))))
    tall = min(wide * rng.uniform(1.2, 1.5), 0.8 * height)
    left = np.clip(u * length - wide / 2, 0.1, length - wide - 0.1)
    low = min(rng.uniform(0.6, 1.8), height - tall - 0.1)
    out = np.array([along[1], -along[0]]) * 0.04
    image = guises.poster(rng)
    start, stop = a + along * left + out, a + along * (left + wide) + out
    quads = wall(start, stop, low, low + tall, Texture(lambda: image), OBJECT)
    return Change("poster", tuple(quads), (start + stop) / 2, 0.0)


def _meet(rng: np.random.Generator, plan: Layout, camera: Camera, others: list[Change]) -> Change | None:
    """Draw one object in front of the camera; None where there is no room for it."""
    kind = str(rng.choice(KINDS, p=_SHARE))
    if kind == "poster":
        return _poster(rng, plan, camera)
    nearest = NEAREST + (3.0 if kind == "car" else 0.0)
    depth = float(np.exp(rng.uniform(np.log(nearest), np.log(FARTHEST))))
    aside = rng.uniform(-0.5, 0.5) * depth * camera.width / camera.focal
    at = camera.position[:2] + turn(camera.heading) @ np.array([depth, -aside])
    radius = RADIUS[kind]
    if not plan.free(at, radius) or any(np.hypot(*(o.at - at)) < radius + RADIUS[o.kind] for o in others):
        return None
    toward = float(np.arctan2(*(camera.position[:2] - at)[::-1]))
    quads = _standing(rng, kind, at, toward)
    return Change(kind, tuple(quads), at, 0.75 * radius)


def meet(rng: np.random.Generator, plan: Layout, camera: Camera, count: int) -> list[Change]:
    """Place change objects before a camera.

    Args:
        rng: of the query and the attempt.
        plan: what they must not stand in, or what they hang on.
        camera: who meets them.
        count: how many are wanted; fewer where there is little room.

    Returns:
        The objects, nearest first. Whether they can be seen is for the caller to find out.
    """
    met: list[Change] = []
    for _ in range(12 * count):
        if len(met) < count and (change := _meet(rng, plan, camera, met)) is not None:
            met.append(change)
    return sorted(met, key=lambda c: float(np.hypot(*(c.at - camera.position[:2]))))


def pedestrian(rng: np.random.Generator, camera: Camera) -> Change:
    """Return a person 4 m ahead: where a query with changes would otherwise see none."""
    at = camera.position[:2] + turn(camera.heading)[:, 0] * 4.0
    return Change("person", tuple(_standing(rng, "person", at, camera.heading + np.pi)), at, 0.3)
