"""Building sites: scaffolds, fenced heaps, half-built partitions, and the machines that work there."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus import guises
from fdslam.data.campus.props import DARK, STEEL, WOOD, Point, clear, ink
from fdslam.data.campus.scene import OBJECT, Quad, box, crossed, plate, turn, wall
from fdslam.data.campus.texture import Color, Texture, plain, shift

PAINTS: tuple[Color, ...] = ((236, 178, 34), (226, 120, 30), (206, 60, 40), (60, 120, 170))
_TIRE, _GLASS = plain((38, 38, 40)), (54, 66, 78)


def _panel(color: Color, glass: bool) -> Texture:
    """Return sheet metal with a seam, a stripe and a name or, of a cab, with windows."""

    def make() -> NDArray[np.uint8]:
        image = np.full((72, 96, 3), np.rint(color), np.uint8)
        cv2.rectangle(image, (0, 0), (95, 71), shift(color, -0.4), 2)
        if glass:
            cv2.rectangle(image, (8, 6), (44, 44), _GLASS, -1)
            cv2.rectangle(image, (52, 6), (87, 44), _GLASS, -1)
            cv2.line(image, (14, 40), (38, 10), (120, 132, 140), 2)
        else:
            cv2.rectangle(image, (4, 50), (91, 62), (40, 40, 42), -1)
            cv2.putText(image, "FD 300", (8, 36), cv2.FONT_HERSHEY_DUPLEX, 0.7, shift(color, -0.7), 2)
            for x in range(66, 90, 5):
                cv2.line(image, (x, 10), (x, 24), shift(color, -0.5), 2)
        return image

    return Texture(make)


def _drum(
    center: NDArray[np.float64], angle: float, radius: float, width: float, face: Texture, hub: Color
) -> list[Quad]:
    """Return a lying cylinder whose axis runs across the direction ``angle``; ``center`` [3] metres."""
    ahead, aside = np.array([*turn(angle)[:, 0], 0]), np.array([*turn(angle)[:, 1], 0])
    rim = np.linspace(0, 2 * np.pi, 13)
    points = center + radius * (np.cos(rim)[:, None] * ahead + np.sin(rim)[:, None] * np.array([0, 0, 1.0]))
    quads = [
        Quad(a - aside * width / 2, aside * width, b - a, face, OBJECT, two_sided=True) for a, b in pairwise(points)
    ]

    def cap() -> NDArray[np.uint8]:
        image = clear(64, 64, (40, 40, 42))
        cv2.circle(image, (32, 32), 31, ink((44, 44, 46)), -1)
        cv2.circle(image, (32, 32), 17, ink(hub), -1)
        for a in np.linspace(0, 2 * np.pi, 6, endpoint=False):
            cv2.circle(image, (int(32 + 10 * np.cos(a)), int(32 + 10 * np.sin(a))), 2, ink((60, 60, 60)), -1)
        return image

    side, down = ahead * 2 * radius, np.array([0, 0, -2.0 * radius])
    corner = center - ahead * radius + np.array([0, 0, radius])
    for end in (-1, 1):
        quads.append(Quad(corner + end * aside * width / 2, side, down, Texture(cap), OBJECT, two_sided=True))
    return quads


def excavator(rng: np.random.Generator, at: Point, angle: float) -> list[Quad]:
    """Return an excavator on tracks, its boom ahead."""
    color = PAINTS[rng.integers(len(PAINTS))]
    ahead, aside = turn(angle).T
    body, cab, top = _panel(color, False), _panel(color, True), plain(shift(color, 0.1))

    def track() -> NDArray[np.uint8]:
        image = np.full((36, 120, 3), 46, np.uint8)
        for x in range(0, 120, 6):
            cv2.line(image, (x, 0), (x, 35), (78, 76, 74), 2)
        for x in range(14, 120, 22):
            cv2.circle(image, (x, 20), 9, (98, 96, 92), -1)
        return image

    reach = int(rng.integers(-18, 18))

    def boom() -> NDArray[np.uint8]:
        image = clear(200, 200, shift(color, -0.3))
        elbow, wrist = (96, 16 + abs(reach)), (160 + reach // 2, 110)
        for a, b, width in (((4, 120), elbow, 22), (elbow, wrist, 16)):
            cv2.line(image, a, b, ink(shift(color, -0.35)), width + 4)
            cv2.line(image, a, b, ink(color), width)
        cv2.line(image, (20, 140), (84, 44 + abs(reach)), ink((170, 172, 174)), 5)
        x, y = wrist
        bucket = np.array(
            [[x - 14, y], [x + 14, y + 4], [x + 20, y + 44], [x - 22, y + 52], [x - 30, y + 26]], np.int32
        )
        cv2.fillPoly(image, [bucket], ink((92, 88, 84)))
        cv2.polylines(image, [bucket], True, ink((50, 48, 46)), 3)
        return image

    quads = [
        q
        for side in (-1, 1)
        for q in box(at + side * 0.8 * aside, (3.0, 0.5), angle, 0, 0.8, Texture(track), DARK, OBJECT)
    ]
    quads += box(at - 0.5 * ahead, (2.6, 1.9), angle, 0.85, 1.75, body, top, OBJECT)
    quads += box(at + 0.35 * ahead + 0.4 * aside, (1.3, 1.0), angle, 0.9, 2.6, cab, top, OBJECT)
    start = at + 0.7 * ahead - 0.25 * aside
    return [*quads, *wall(start, start + 3.0 * ahead, 0.1, 3.1, Texture(boom), OBJECT, two_sided=True)]


def roller(rng: np.random.Generator, at: Point, angle: float) -> list[Quad]:
    """Return a road roller."""
    color = PAINTS[rng.integers(len(PAINTS))]
    ahead, aside = turn(angle).T
    body, top = _panel(color, False), plain(shift(color, 0.1))
    quads = [
        q for s in (-1, 1) for q in _drum(np.array([*(at + s * 1.05 * ahead), 0.56]), angle, 0.56, 1.3, STEEL, color)
    ]
    quads += box(at, (2.3, 1.1), angle, 0.75, 1.35, body, top, OBJECT)
    quads += box(at - 0.2 * ahead, (0.5, 0.6), angle, 1.35, 1.75, plain((40, 42, 46)), DARK, OBJECT)
    for x in (-0.85, 0.75):
        for y in (-0.5, 0.5):
            quads += box(at + x * ahead + y * aside, (0.07, 0.07), angle, 1.35, 2.45, DARK, None, OBJECT)
    quads.append(plate(at - 0.05 * ahead, (2.0, 1.3), angle, 2.45, top, OBJECT))
    return [*quads, *box(at - 0.05 * ahead, (2.0, 1.3), angle, 2.37, 2.45, top, None, OBJECT)]


def dumper(rng: np.random.Generator, at: Point, angle: float) -> list[Quad]:
    """Return a small dumper with a load of earth."""
    color = PAINTS[rng.integers(len(PAINTS))]
    ahead, aside = turn(angle).T
    wheels = [(x, y) for x in (-0.85, 0.85) for y in (-0.68, 0.68)]
    quads = [
        q
        for x, y in wheels
        for q in _drum(np.array([*(at + x * ahead + y * aside), 0.42]), angle, 0.42, 0.34, _TIRE, color)
    ]
    panel, top = _panel(color, False), plain(shift(color, 0.1))
    quads += box(at - 0.6 * ahead, (1.4, 1.0), angle, 0.5, 1.1, panel, top, OBJECT)
    quads += box(at + 0.75 * ahead, (1.4, 1.5), angle, 0.6, 1.35, panel, plain((104, 84, 62)), OBJECT)
    quads += crossed(at + 0.75 * ahead, 1.2, 1.3, 1.65, angle, Texture(lambda: heap((112, 90, 66), 5)), OBJECT, 2)
    for y in (-0.45, 0.45):
        quads += box(at - 0.95 * ahead + y * aside, (0.07, 0.07), angle, 1.1, 2.3, DARK, None, OBJECT)
    return [*quads, *box(at - 0.95 * ahead, (0.07, 0.97), angle, 2.23, 2.3, DARK, DARK, OBJECT)]


def heap(color: Color, seed: int) -> NDArray[np.uint8]:
    """Paint a heap of earth, sand or gravel [96, 192, 4]."""
    rng = np.random.default_rng(seed)
    image = clear(96, 192, color)
    x = np.arange(0, 193, 8)
    y = 92 - 84 * np.exp(-(((x - 96) / 52.0) ** 2)) + rng.normal(0, 2.5, len(x))
    outline = np.concatenate([np.stack([x, y], 1), [[192, 96], [0, 96]]]).astype(np.int32)
    cv2.fillPoly(image, [outline], ink(color))
    for _ in range(500):
        u, v = int(rng.integers(0, 192)), int(rng.integers(0, 96))
        if image[v, u, 3]:
            cv2.circle(image, (u, v), int(rng.integers(1, 4)), ink(shift(color, rng.uniform(-0.35, 0.25))), -1)
    return image


def _mesh_fence() -> NDArray[np.uint8]:
    """Paint a panel of a site fence [128, 192, 4]: wire in a frame, and a sheet with stripes."""
    image = clear(128, 192, (150, 152, 154))
    for x in range(0, 192, 12):
        cv2.line(image, (x, 0), (x, 127), ink((150, 152, 154)), 2)
    for y in range(0, 128, 16):
        cv2.line(image, (0, y), (191, y), ink((150, 152, 154)), 2)
    cv2.rectangle(image, (0, 0), (191, 127), ink((122, 124, 126)), 7)
    image[52:92, 14:178] = (*(232, 232, 226), 255)
    for x in range(-40, 180, 28):
        stripe = np.array([[x, 92], [x + 14, 92], [x + 42, 52], [x + 28, 52]], np.int32).clip([14, 52], [178, 92])
        cv2.fillPoly(image, [stripe], ink((214, 60, 40)))
    return image


def site(rng: np.random.Generator, at: Point, angle: float) -> list[Quad]:
    """Return a fenced heap with bricks and boards beside it; the fence faces the direction ``angle``."""
    tones: tuple[Color, ...] = ((122, 98, 72), (196, 176, 132), (142, 140, 136))
    color, number = tones[rng.integers(3)], int(rng.integers(1 << 30))
    ahead, aside = turn(angle).T
    quads = crossed(
        at - 0.2 * ahead,
        2.6,
        -0.05,
        rng.uniform(0.9, 1.5),
        angle + 0.4,
        Texture(lambda: heap(color, number)),
        OBJECT,
        3,
    )
    brick = Texture(lambda: np.tile(np.array([[[164, 84, 62], [142, 70, 54], [176, 98, 74]]], np.uint8), (6, 4, 1)))
    quads += box(at - 0.6 * ahead + 1.3 * aside, (0.9, 0.6), angle, 0, rng.uniform(0.4, 0.9), brick, brick, OBJECT)
    fence = Texture(_mesh_fence)
    front = at + 1.35 * ahead
    quads += wall(front - 2.0 * aside, front, 0.02, 1.7, fence, OBJECT, two_sided=True)
    quads += wall(front, front + 2.0 * aside, 0.02, 1.7, fence, OBJECT, two_sided=True)
    for side in (-2.0, 2.0):
        back = front + side * aside
        quads += wall(back, back - 2.0 * ahead, 0.02, 1.7, fence, OBJECT, two_sided=True)
    return quads


def scaffold(rng: np.random.Generator, left: Point, right: Point, out: Point, height: float) -> list[Quad]:
    """Return a scaffold before a facade, partly hung with sheets.

    Args:
        rng: which sheets hang.
        left: left foot at the facade as seen from outside, metres.
        right: right foot, metres.
        out: unit vector away from the facade.
        height: metres.
    """
    wide = float(np.linalg.norm(right - left))
    sheet: Color = [(70, 120, 168), (206, 210, 206), (64, 136, 96), (226, 140, 60)][rng.integers(4)]
    holes = rng.random((int(height // 2) + 1, int(wide // 2) + 1)) < 0.5

    def front() -> NDArray[np.uint8]:
        image = clear(round(height * 40), round(wide * 40), (150, 152, 150))
        h, w = image.shape[:2]
        for row, hung in enumerate(holes):
            for column, covered in enumerate(hung):
                x, y = column * 80, row * 80
                if covered:
                    folds = (1 + 0.12 * np.sin(np.arange(80) / 3.7 + row))[None, :, None] * np.array(sheet)
                    part = image[y + 4 : y + 78, x : x + 80]
                    part[..., :3] = np.clip(folds, 0, 255).astype(np.uint8)[:, : part.shape[1]]
                    part[..., 3] = 255
                elif (row + column) % 2:
                    cv2.line(image, (x, y), (x + 80, y + 80), ink((140, 142, 140)), 3)
        for y in range(0, h, 80):
            cv2.rectangle(image, (0, y), (w, y + 5), ink((166, 128, 82)), -1)
            cv2.line(image, (0, y + 40), (w, y + 40), ink((150, 152, 150)), 2)
        for x in range(0, w, 80):
            cv2.line(image, (x, 0), (x, h), ink((130, 132, 132)), 5)
        cv2.line(image, (w - 3, 0), (w - 3, h), ink((130, 132, 132)), 5)
        return image

    near, texture = 0.95 * out, Texture(front)
    quads = wall(left + near, right + near, 0, height, texture, OBJECT, column=3.0, two_sided=True)
    for z in np.arange(2.0, height, 2.0):
        middle, angle = (left + right) / 2 + near / 2, float(np.arctan2(*(right - left)[::-1]))
        quads.append(replace(plate(middle, (wide, 0.9), angle, height - z, WOOD, OBJECT), two_sided=True))
    return quads


def partition(rng: np.random.Generator, left: Point, right: Point) -> list[Quad]:
    """Return a half-built partition from ``left`` to ``right`` foot: studs, boards and a sheet of foil."""
    wide, tall = float(np.linalg.norm(right - left)), float(rng.uniform(2.0, 2.6))
    boards = rng.random(int(wide / 0.6) + 1) < 0.55
    tone: Color = [(214, 212, 206), (196, 204, 186), (206, 188, 160)][rng.integers(3)]

    def make() -> NDArray[np.uint8]:
        image = clear(round(tall * 60), round(wide * 60), (176, 138, 92))
        h, w = image.shape[:2]
        for k, covered in enumerate(boards):
            if covered:
                cv2.rectangle(image, (k * 36, h // 6), (k * 36 + 35, h), ink(shift(tone, 0.05 * (k % 3 - 1))), -1)
                for y in range(h // 6 + 8, h, 22):
                    cv2.circle(image, (k * 36 + 4, y), 1, ink((110, 110, 110)), -1)
        for x in range(0, w, 36):
            cv2.rectangle(image, (x, 0), (x + 5, h), ink((182, 142, 94)), -1)
        for y in (0, h // 2, h - 7):
            cv2.rectangle(image, (0, y), (w, y + 6), ink((166, 128, 82)), -1)
        return image

    return wall(left, right, 0, tall, Texture(make), OBJECT, two_sided=True)


def barrier(rng: np.random.Generator, at: Point, angle: float) -> list[Quad]:
    """Return a striped barrier that faces the direction ``angle``."""
    image, wide = guises.barrier(rng), rng.uniform(1.4, 2.2)
    half = turn(angle)[:, 1] * wide / 2
    return wall(at - half, at + half, 0, 0.5 * wide, Texture(lambda: image), OBJECT, two_sided=True)
