"""Things that belong to the map: lamp posts, signs, benches, bicycles, bins and cars."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus.flora import SNOW
from fdslam.data.campus.scene import OBJECT, Quad, box, crossed, plate, turn, wall
from fdslam.data.campus.texture import Color, Texture, plain, shift

Point = NDArray[np.float64]  # [2] metres on the ground
STEEL = plain((96, 100, 104))
GREEN = plain((46, 92, 70))
DARK = plain((52, 56, 58))
PALE = plain((232, 230, 214))
WOOD = plain((150, 108, 70))
WHITE = plain(SNOW)
PAINTS: tuple[Color, ...] = (
    (178, 40, 38), (38, 70, 140), (226, 226, 222), (44, 46, 50), (150, 156, 162), (40, 104, 74), (214, 170, 52)
)  # fmt: skip
CAR_LENGTH, CAR_WIDTH, CAR_HEIGHT = 4.2, 1.74, 1.46  # metres


def ink(color: Color) -> tuple[float, float, float, float]:
    """Return the colour as an opaque RGBA one."""
    return (*color, 255.0)


def clear(height: int, width: int, color: Color) -> NDArray[np.uint8]:
    """Return a hole [height, width, 4] of a colour, which is what shows through where edges are averaged."""
    image = np.zeros((height, width, 4), np.uint8)
    image[..., :3] = np.rint(color)
    return image


def lamp(at: Point, angle: float, height: float) -> list[Quad]:
    """Return a lamp post with its lantern on an arm."""
    head = at + turn(angle)[:, 0] * 0.45
    return [
        *box(at, (0.11, 0.11), angle, 0, height, STEEL, None, OBJECT),
        *box(at, (0.24, 0.24), angle, 0, 0.5, DARK, DARK, OBJECT),
        *box((at + head) / 2, (0.55, 0.06), angle, height - 0.1, height - 0.02, STEEL, STEEL, OBJECT),
        *box(head, (0.55, 0.26), angle, height - 0.22, height - 0.06, PALE, DARK, OBJECT),
    ]


def sign_face(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Paint a signpost's face [96, 128, 3]: an arrow and words on a strong colour."""
    color = PAINTS[rng.integers(len(PAINTS))]
    image = np.full((96, 128, 3), np.rint(color), np.uint8)
    pale = (246, 244, 236) if sum(color) < 480 else (30, 34, 60)
    cv2.rectangle(image, (3, 3), (124, 92), pale, 2)
    cv2.arrowedLine(image, (14, 70), (50 + int(rng.integers(0, 50)), 70), pale, 5, tipLength=0.4)
    word = "".join("ABEHKLMNORSTU"[i] for i in rng.integers(0, 13, 5))
    cv2.putText(image, word, (10, 40), cv2.FONT_HERSHEY_DUPLEX, 1.1, pale, 2, cv2.LINE_AA)
    return image


def sign(at: Point, angle: float, face: Texture) -> list[Quad]:
    """Return a sign on a post that faces the direction ``angle``."""
    side = turn(angle)[:, 1] * 0.55
    front = at + turn(angle)[:, 0] * 0.06
    return [
        *box(at, (0.08, 0.08), angle, 0, 2.3, STEEL, None, OBJECT),
        *wall(front - side, front + side, 1.4, 2.25, face, OBJECT),
        *wall(front + side, front - side, 1.4, 2.25, DARK, OBJECT),
    ]


def _slats(legs: bool) -> NDArray[np.uint8]:
    """Paint a bench's slatted front [64, 160, 4]."""
    image = clear(64, 160, (110, 80, 52))
    for y in range(2, 62 if not legs else 24, 12):
        cv2.rectangle(image, (0, y), (159, y + 7), ink((150, 104, 66)), -1)
        cv2.line(image, (0, y + 7), (159, y + 7), ink((96, 66, 42)), 1)
    for x in (10, 140):
        cv2.rectangle(image, (x, 0), (x + 8, 63), ink((60, 62, 64)), -1)
    return image


_BACK, _FRONT = Texture(lambda: _slats(False)), Texture(lambda: _slats(True))


def bench(at: Point, angle: float, cover: Texture | None = None) -> list[Quad]:
    """Return a bench that faces the direction ``angle``; ``cover`` lies on its seat."""
    ahead, side = turn(angle)[:, 0], turn(angle)[:, 1] * 0.9
    back, front = at - ahead * 0.25, at + ahead * 0.22
    return [
        *wall(back - side, back + side, 0.45, 0.95, _BACK, OBJECT, two_sided=True),
        *wall(front - side, front + side, 0.0, 0.45, _FRONT, OBJECT, two_sided=True),
        plate(at, (0.5, 1.8), angle, 0.46, cover or WOOD, OBJECT),
    ]


def _bicycle(color: Color) -> NDArray[np.uint8]:
    """Paint a bicycle from its side [112, 180, 4]."""
    image = clear(112, 180, shift(color, -0.4))
    for x in (38, 142):
        cv2.circle(image, (x, 76), 32, ink((36, 36, 38)), 4)
        cv2.circle(image, (x, 76), 4, ink((150, 150, 150)), -1)
        for a in np.linspace(0, np.pi, 5, endpoint=False):
            d = np.array([np.cos(a), np.sin(a)]) * 30
            cv2.line(image, (int(x - d[0]), int(76 - d[1])), (int(x + d[0]), int(76 + d[1])), ink((150, 152, 154)), 1)
    joints = {"rear": (38, 76), "crank": (82, 78), "seat": (68, 32), "head": (126, 30), "front": (142, 76)}
    for tube in ("rear crank", "crank seat", "seat rear", "seat head", "crank head", "head front"):
        a, b = tube.split()
        cv2.line(image, joints[a], joints[b], ink(color), 5)
    cv2.line(image, (56, 22), (82, 22), ink((30, 30, 30)), 6)
    cv2.line(image, (68, 32), (68, 22), ink((90, 90, 92)), 4)
    cv2.line(image, (126, 30), (122, 12), ink((90, 90, 92)), 4)
    cv2.line(image, (122, 12), (106, 16), ink((30, 30, 30)), 5)
    return image


def bicycle(at: Point, angle: float, texture: Texture) -> list[Quad]:
    """Return a bicycle along the direction ``angle``."""
    half = turn(angle)[:, 0] * 0.88
    return wall(at - half, at + half, 0, 1.08, texture, OBJECT, two_sided=True)


BICYCLES = tuple(Texture(lambda c=c: _bicycle(c)) for c in PAINTS)  # type: ignore[misc]


def bin_(at: Point, angle: float, side: Texture, cover: Texture | None = None) -> list[Quad]:
    """Return a waste bin; ``cover`` lies on its lid."""
    return box(at, (0.55, 0.6), angle, 0, 1.0, side, cover or DARK, OBJECT)


def bollard(at: Point) -> list[Quad]:
    """Return a bollard."""
    return crossed(at, 0.16, 0, 0.95, 0.3, DARK, OBJECT, 2)


def _profile(color: Color, snow: float) -> NDArray[np.uint8]:
    """Paint a car from its side [146, 420, 4], 100 pixels per metre, driving to the left; snow lies on top."""
    image = clear(146, 420, shift(color, -0.5))
    xs = [4, 2, 18, 108, 160, 190, 290, 328, 388, 414, 418]
    ys = [118, 84, 66, 56, 8, 2, 2, 10, 56, 64, 118]
    cv2.fillPoly(image, [np.array([xs, ys], np.int32).T], ink(color))
    cv2.fillPoly(image, [np.array([[3, 96], [417, 96], [418, 118], [4, 118]], np.int32)], ink(shift(color, -0.35)))
    front, rear = [[126, 56], [168, 14], [226, 12], [226, 56]], [[236, 56], [236, 12], [290, 12], [320, 18], [360, 56]]
    for glass in (front, rear):
        cv2.fillPoly(image, [np.array(glass, np.int32)], ink((42, 54, 66)))
        cv2.line(image, tuple(glass[0]), tuple(glass[1]), ink((150, 160, 170)), 2)
    if snow:
        cv2.polylines(image, [np.array([xs[2:9], ys[2:9]], np.int32).T], False, ink(SNOW), 7)
    for x in (116, 231, 338):
        cv2.line(image, (x, 58), (x, 114), ink(shift(color, -0.5)), 2)
    cv2.line(image, (10, 72), (410, 70), ink(shift(color, 0.35)), 2)
    for x in (206, 318):
        cv2.rectangle(image, (x, 66), (x + 18, 71), ink((210, 210, 210)), -1)
    cv2.rectangle(image, (4, 68), (20, 80), ink((250, 246, 214)), -1)
    cv2.rectangle(image, (404, 66), (416, 80), ink((190, 30, 30)), -1)
    for x in (82, 336):
        cv2.circle(image, (x, 112), 33, ink((24, 24, 26)), -1)
        cv2.circle(image, (x, 112), 20, ink((176, 180, 184)), -1)
        for a in np.linspace(0, 2 * np.pi, 5, endpoint=False):
            cv2.line(image, (x, 112), (int(x + 18 * np.cos(a)), int(112 + 18 * np.sin(a))), ink((70, 72, 76)), 4)
    return image


def _end(color: Color, rear: bool) -> NDArray[np.uint8]:
    """Paint a car's front or rear below the bonnet [62, 174, 3]."""
    image = np.full((62, 174, 3), np.rint(color), np.uint8)
    cv2.rectangle(image, (0, 44), (173, 61), (36, 38, 40), -1)
    for x in (4, 138):
        cv2.rectangle(image, (x, 6), (x + 32, 20), (190, 26, 26) if rear else (252, 250, 226), -1)
    if not rear:
        cv2.rectangle(image, (46, 10), (128, 26), (40, 42, 44), -1)
    cv2.rectangle(image, (60, 30), (114, 42), (244, 244, 238), -1)
    cv2.putText(image, "K 47 FD", (63, 40), cv2.FONT_HERSHEY_PLAIN, 0.8, (20, 20, 40), 1)
    return image


def car_textures(color: Color, snow: float = 0.0) -> tuple[Texture, ...]:
    """Return the textures of a car of one colour: left and right side, front, rear, sheet metal, glass."""
    side = Texture(lambda: _profile(color, snow))
    other = Texture(lambda: np.ascontiguousarray(_profile(color, snow)[:, ::-1]))
    front, rear = Texture(lambda: _end(color, False)), Texture(lambda: _end(color, True))
    return side, other, front, rear, WHITE if snow else plain(shift(color, 0.08)), plain((58, 72, 86))


def car(at: Point, angle: float, textures: tuple[Texture, ...]) -> list[Quad]:
    """Return a car that drives in the direction ``angle``: two cut-out sides and the sheet metal between them."""
    left, right, front, rear, metal, glass = textures
    along, across = turn(angle)[:, 0], turn(angle)[:, 1]

    def foot(x: float, y: float) -> NDArray[np.float64]:
        return at + along * (CAR_LENGTH / 2 - x) + across * y

    half = CAR_WIDTH / 2
    quads = [
        *wall(foot(CAR_LENGTH, -half), foot(0, -half), 0, CAR_HEIGHT, right, OBJECT),
        *wall(foot(0, half), foot(CAR_LENGTH, half), 0, CAR_HEIGHT, left, OBJECT),
        *wall(foot(0.02, -half), foot(0.02, half), 0.2, 0.8, front, OBJECT),
        *wall(foot(4.18, half), foot(4.18, -half), 0.2, 0.8, rear, OBJECT),
    ]
    # The outline between the sides, as (x, z) in metres behind the front and above the ground.
    outline = [(0.02, 0.8), (1.08, 0.9), (1.7, 1.42), (3.2, 1.42), (3.88, 0.9), (4.18, 0.8)]
    covers = (metal, glass, metal, glass, metal)
    for (x0, z0), (x1, z1), texture in zip(outline[:-1], outline[1:], covers, strict=True):
        a, b = np.array([*foot(x1, half), z1]), np.array([*foot(x0, half), z0])
        width = np.array([*(-across * CAR_WIDTH), 0.0])
        quads.append(Quad(a, width, b - a, texture, OBJECT, two_sided=True))
    return quads
