"""The passage: a corridor through a building, open at both ends, so that the path runs from outdoors to indoors."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus import interior, props
from fdslam.data.campus.layout import Building, Passage
from fdslam.data.campus.scene import BUILDING, GROUND, OBJECT, Quad, box, plate, wall
from fdslam.data.campus.seeds import stream
from fdslam.data.campus.texture import Texture, plain

FLOOR = 0.012  # metres above the ground: just enough to win against it
_PIECE = 1.5  # metres: longest piece of wall, floor or ceiling with one resolution
_FRAME = plain((88, 92, 98))
_LINTEL = plain((120, 122, 126))


def indoors(quads: Iterable[Quad]) -> list[Quad]:
    """Return the quads as they are under the lamps."""
    return [replace(q, indoor=True) for q in quads]


def _split(quad: Quad, length: float) -> list[Quad]:
    cuts = np.linspace(0, 1, int(np.ceil(length / _PIECE)) + 1)
    return [replace(quad, span=(float(a), float(b))) for a, b in pairwise(cuts)]


def _swing(push: bool) -> NDArray[np.uint8]:
    """Paint a glass door [150, 80, 4] in its frame; the glass is a hole but for a sticker."""
    image = props.clear(150, 80, (88, 92, 98))
    cv2.rectangle(image, (0, 0), (79, 149), props.ink((88, 92, 98)), 12)
    cv2.rectangle(image, (0, 118), (79, 149), props.ink((104, 108, 114)), -1)
    cv2.rectangle(image, (8, 70), (72, 76), props.ink((196, 198, 200)), -1)
    cv2.rectangle(image, (26, 40), (54, 56), props.ink((40, 90, 160) if push else (190, 50, 44)), -1)
    return image


def _exit() -> NDArray[np.uint8]:
    """Paint an exit sign [40, 96, 3]."""
    image = np.full((40, 96, 3), (24, 124, 66), np.uint8)
    cv2.putText(image, "EXIT", (8, 30), cv2.FONT_HERSHEY_DUPLEX, 0.9, (244, 250, 244), 2, cv2.LINE_AA)
    cv2.arrowedLine(image, (76, 32), (76, 10), (244, 250, 244), 3, tipLength=0.5)
    return image


def entrance(p: Passage, b: Building, face: int, facade: Texture) -> list[Quad]:
    """Return the face of the building at an end of the passage: the wall about the opening, its frame and a canopy."""
    left, right = b.feet[face], b.feet[(face + 1) % 4]
    along = (right - left) / np.linalg.norm(right - left)
    wide = float(np.linalg.norm(right - left))
    low, high = ((wide / 2 + side * p.half) / wide for side in (-1, 1))
    whole = wall(left, right, 0, b.height, facade, BUILDING)[0]

    def above() -> NDArray[np.uint8]:
        image = facade.level(0, 0)
        return image[: round(image.shape[0] * (b.height - p.height) / b.height)]

    upper = wall(left, right, p.height, b.height, Texture(above), BUILDING)[0]
    quads = [replace(whole, span=(0.0, low)), replace(whole, span=(high, 1.0)), replace(upper, span=(low, high))]
    out = np.array([along[1], -along[0]])
    angle = float(np.arctan2(along[1], along[0]))
    middle = (left + right) / 2
    for side in (-1, 1):
        foot = middle + side * (p.half + 0.16) * along + 0.12 * out
        quads += box(foot, (0.32, 0.3), angle, 0, p.height, _LINTEL, None, BUILDING)
    quads += box(
        middle + 0.12 * out, (2 * p.half + 0.64, 0.3), angle, p.height, p.height + 0.35, _LINTEL, None, BUILDING
    )
    canopy = middle + 0.9 * out
    size = (2 * p.half + 1.6, 1.8)
    quads += box(canopy, size, angle, p.height + 0.35, p.height + 0.5, _FRAME, None, BUILDING)
    under = plate(canopy, size, angle, p.height + 0.35, _FRAME, BUILDING)
    return [*quads, replace(under, two_sided=True)]


def passage(p: Passage, seed: int, session: str) -> list[Quad]:
    """Return the corridor's surfaces, seen from within, and what hangs in it."""
    length, width = p.east - p.west, 2 * p.half
    south, north = p.middle - p.half, p.middle + p.half

    def side(name: str) -> Texture:
        def make() -> NDArray[np.uint8]:
            rng, today = stream(seed, "passage", name), stream(seed, "passage", session, name)
            return interior.wall_face(rng, today, length, p.height)

        return Texture(make)

    bottom = Texture(lambda: interior.floor(stream(seed, "floor"), length, width))
    top = Texture(lambda: interior.ceiling(stream(seed, "ceiling"), length, width))
    a, b = np.array([p.west, north]), np.array([p.east, north])
    c, d = np.array([p.east, south]), np.array([p.west, south])
    quads = _split(wall(a, b, 0, p.height, side("north"), BUILDING)[0], length)
    quads += _split(wall(c, d, 0, p.height, side("south"), BUILDING)[0], length)
    ground = plate(np.array([0.5 * (p.west + p.east), p.middle]), (length, width), 0.0, FLOOR, bottom, GROUND)
    quads += _split(ground, length)
    under = Quad(np.array([*d, p.height]), np.array([length, 0.0, 0.0]), np.array([0.0, width, 0.0]), top, BUILDING)
    quads += _split(under, length)
    sign = Texture(_exit)
    for x in (p.west + 7.0, p.east - 7.0):
        for one, other in ((-0.5, 0.5), (0.5, -0.5)):
            start, stop = np.array([x, p.middle + one]), np.array([x, p.middle + other])
            quads += wall(start, stop, p.height - 0.5, p.height - 0.1, sign, OBJECT)
    for x, inward in ((p.west, 1), (p.east, -1)):
        for y in (south + 0.07, north - 0.07):
            leaf = Texture(lambda x=x, y=y: _swing(x + y > p.middle))  # type: ignore[misc]
            start, stop = np.array([x + 0.05 * inward, y]), np.array([x + 1.35 * inward, y])
            quads += wall(start, stop, FLOOR, 2.5, leaf, BUILDING, two_sided=True)
    return indoors(quads)


def locker(at: NDArray[np.float64], angle: float, length: float, look: int) -> list[Quad]:
    """Return a row of lockers along a wall of the passage."""
    colors = ((72, 104, 150), (150, 62, 56), (86, 132, 96), (178, 170, 152))

    def front() -> NDArray[np.uint8]:
        image = np.full((108, round(60 * length), 3), colors[look], np.uint8)
        for x in range(0, image.shape[1], 24):
            cv2.rectangle(image, (x, 0), (x + 23, 107), (58, 60, 64), 1)
            for y in (10, 15, 20):
                cv2.line(image, (x + 6, y), (x + 17, y), (58, 60, 64), 1)
            cv2.rectangle(image, (x + 17, 50), (x + 20, 60), (214, 214, 210), -1)
        return image

    return indoors(box(at, (length, 0.45), angle, 0, 1.8, Texture(front), _FRAME, OBJECT))
