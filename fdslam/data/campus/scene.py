"""Geometry: textured parallelograms, and the walls, plates and boxes made of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus.texture import Texture
from fdslam.types import LABELS

SKY, GROUND, BUILDING, VEGETATION, OBJECT = range(len(LABELS))


@dataclass(frozen=True)
class Quad:
    """The parallelogram origin + s·right + t·down, s and t in 0..1, with a texture laid over it."""

    origin: NDArray[np.float64]  # [3] metres: the texture's top left corner
    right: NDArray[np.float64]  # [3] metres: along the texture's width, seen from outside
    down: NDArray[np.float64]  # [3] metres: along the texture's height
    texture: Texture
    label: int  # index into LABELS
    span: tuple[float, float] = (0.0, 1.0)  # the part s0 <= s <= s1 that is drawn
    two_sided: bool = False
    lit: bool = True  # False: evenly lit, as leaves are
    indoor: bool = False  # lit by lamps


@dataclass(frozen=True)
class Mesh:
    """Quads as arrays."""

    origin: NDArray[np.float64]  # [Q, 3]
    right: NDArray[np.float64]  # [Q, 3]
    down: NDArray[np.float64]  # [Q, 3]
    span: NDArray[np.float64]  # [Q, 2]
    normal: NDArray[np.float64]  # [Q, 3] unit, outward
    two_sided: NDArray[np.bool_]  # [Q]
    lit: NDArray[np.bool_]  # [Q]
    indoor: NDArray[np.bool_]  # [Q]
    label: NDArray[np.int32]  # [Q] index into LABELS
    item: NDArray[np.int32]  # [Q] number of the change object, or -1
    textures: tuple[Texture, ...]  # [Q]


def mesh(quads: Sequence[Quad], items: Sequence[int] | None = None) -> Mesh:
    """Collect quads; ``items`` gives each its change object (default: none)."""
    origin = np.array([q.origin for q in quads], float).reshape(-1, 3)
    right = np.array([q.right for q in quads], float).reshape(-1, 3)
    down = np.array([q.down for q in quads], float).reshape(-1, 3)
    normal = np.cross(down, right)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    return Mesh(
        origin,
        right,
        down,
        np.array([q.span for q in quads], float).reshape(-1, 2),
        normal,
        np.array([q.two_sided for q in quads], bool),
        np.array([q.lit for q in quads], bool),
        np.array([q.indoor for q in quads], bool),
        np.array([q.label for q in quads], np.int32),
        np.full(len(quads), -1, np.int32) if items is None else np.array(items, np.int32),
        tuple(q.texture for q in quads),
    )


def turn(angle: float) -> NDArray[np.float64]:
    """Return the rotation matrix [2, 2] by ``angle`` radians."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def wall(
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    low: float,
    high: float,
    texture: Texture,
    label: int,
    column: float = np.inf,
    two_sided: bool = False,
    lit: bool = True,
) -> list[Quad]:
    """Return an upright quad over the ground points ``a`` to ``b`` [2] (left to right, seen from outside).

    Args:
        a: left foot, metres.
        b: right foot, metres.
        low: height of the lower edge, metres.
        high: height of the upper edge, metres.
        texture: of the whole wall.
        label: index into LABELS.
        column: widest piece, metres; longer walls are split, so that each piece gets the resolution it needs.
        two_sided: drawn from behind too.
        lit: shaded by its orientation.
    """
    n = max(1, int(np.ceil(np.hypot(*(b - a)) / column)))
    cuts = np.linspace(0, 1, n + 1)
    origin, right = np.array([*a, high]), np.array([*(b - a), 0.0])
    down = np.array([0.0, 0.0, low - high])
    return [Quad(origin, right, down, texture, label, (float(s), float(t)), two_sided, lit) for s, t in pairwise(cuts)]


def plate(
    center: NDArray[np.float64], size: tuple[float, float], angle: float, z: float, texture: Texture, label: int
) -> Quad:
    """Return a level quad seen from above; ``size`` is (along, across) the direction ``angle``, metres."""
    axes = turn(angle)
    along, across = axes[:, 0] * size[0], axes[:, 1] * size[1]
    corner = center - along / 2 + across / 2
    return Quad(np.array([*corner, z]), np.array([*along, 0.0]), np.array([*-across, 0.0]), texture, label)


def corners(center: NDArray[np.float64], size: tuple[float, float], angle: float) -> NDArray[np.float64]:
    """Return the ground corners [4, 2] of a rectangle: consecutive pairs are its walls, left to right from outside."""
    half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.array(size) / 2
    return center + half @ turn(angle).T


def box(
    center: NDArray[np.float64],
    size: tuple[float, float],
    angle: float,
    low: float,
    high: float,
    side: Texture,
    top: Texture | None,
    label: int,
) -> list[Quad]:
    """Return the four sides and the top (if any) of an upright box."""
    feet = corners(center, size, angle)
    quads = [q for i in range(4) for q in wall(feet[i], feet[(i + 1) % 4], low, high, side, label)]
    return quads if top is None else [*quads, plate(center, size, angle, high, top, label)]


def crossed(
    at: NDArray[np.float64], width: float, low: float, high: float, angle: float, texture: Texture, label: int, n: int
) -> list[Quad]:
    """Return ``n`` upright quads through one axis, seen from both sides and evenly lit."""
    quads = []
    for k in range(n):
        half = turn(angle + k * np.pi / n)[:, 0] * width / 2
        quads += wall(at - half, at + half, low, high, texture, label, two_sided=True, lit=False)
    return quads
