"""What change objects look like: textures painted anew for every object."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus.props import clear, ink
from fdslam.data.campus.texture import Color, shift

SKIN: tuple[Color, ...] = ((236, 196, 166), (206, 152, 116), (146, 98, 70), (92, 62, 48))


def color(rng: np.random.Generator) -> Color:
    """Draw a colour, often a strong one."""
    hsv = np.array([[[rng.integers(0, 180), rng.integers(60, 230), rng.integers(70, 240)]]], np.uint8)
    r, g, b = cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB)[0, 0].tolist()
    return float(r), float(g), float(b)


def person(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Paint a standing or walking person [400, 176, 4]."""
    coat, legs, skin = color(rng), shift(color(rng), -0.45), SKIN[rng.integers(4)]
    hair: Color = [(38, 30, 26), (94, 62, 36), (196, 160, 96), (150, 150, 148)][rng.integers(4)]
    image = clear(400, 176, shift(coat, -0.4))
    stride, swing = int(rng.integers(4, 36)), int(rng.integers(6, 34))
    for side in (-1, 1):
        hip, knee = (88 + 12 * side, 214), (88 + side * (12 + stride // 2), 296)
        foot = (88 + side * (12 + stride), 380)
        shade = shift(legs, 0.12 * side)
        cv2.line(image, hip, knee, ink(shade), 30)
        cv2.line(image, knee, foot, ink(shade), 23)
        cv2.ellipse(image, (foot[0] + 8, 388), (21, 10), 0, 0, 360, ink((34, 30, 32)), -1)
        shoulder, elbow = (88 + 32 * side, 92), (88 + side * (42 + swing // 3), 152)
        hand = (88 + side * (38 + swing), 206)
        cv2.line(image, shoulder, elbow, ink(shift(coat, -0.18)), 23)
        cv2.line(image, elbow, hand, ink(shift(coat, -0.25)), 19)
        cv2.circle(image, hand, 10, ink(skin), -1)
    torso = np.array([[54, 82], [122, 82], [132, 140], [126, 226], [50, 226], [44, 140]], np.int32)
    cv2.fillPoly(image, [torso], ink(coat))
    pick = rng.integers(3)
    if pick == 0:
        for y in range(98, 222, 20):
            cv2.line(image, (50, y), (126, y), ink(shift(coat, 0.5)), 7)
    elif pick == 1:
        cv2.line(image, (88, 84), (88, 224), ink(shift(coat, -0.5)), 3)
        cv2.line(image, (60, 86), (118, 200), ink((50, 44, 40)), 7)
        cv2.rectangle(image, (100, 186), (142, 236), ink(color(rng)), -1)
        cv2.rectangle(image, (100, 186), (142, 200), ink((46, 42, 40)), -1)
    else:
        cv2.rectangle(image, (62, 104), (114, 140), ink(color(rng)), -1)
        cv2.putText(image, str(rng.integers(10, 99)), (66, 134), cv2.FONT_HERSHEY_DUPLEX, 1.1, ink((250, 250, 250)), 2)
        image[104:140, 62:114, 3] = 255  # smoothed letters leave pinholes
    cv2.rectangle(image, (78, 62), (98, 88), ink(shift(skin, -0.15)), -1)
    cv2.ellipse(image, (88, 42), (23, 30), 0, 0, 360, ink(skin), -1)
    cv2.ellipse(image, (88, 32), (25, 23), 0, 170, 370, ink(hair), -1)
    if rng.random() < 0.4:
        cv2.rectangle(image, (62, 30), (72, 76), ink(hair), -1)
        cv2.rectangle(image, (104, 30), (114, 76), ink(hair), -1)
    for x in (80, 97):
        cv2.circle(image, (x, 42), 3, ink((30, 26, 24)), -1)
    cv2.line(image, (82, 58), (95, 58), ink((150, 70, 66)), 2)
    return image


def poster(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Paint a poster [240, 180, 3]: a picture of coarse shapes, a headline and small print."""
    ground = color(rng)
    image = np.full((240, 180, 3), np.rint(ground), np.uint8)
    for _ in range(int(rng.integers(4, 9))):
        x, y, r = int(rng.integers(0, 180)), int(rng.integers(50, 190)), int(rng.integers(10, 55))
        if rng.random() < 0.5:
            cv2.circle(image, (x, y), r, color(rng), -1, cv2.LINE_AA)
        else:
            shape = np.array([x, y]) + rng.integers(-r, r, (4, 2))
            cv2.fillPoly(image, [shape.astype(np.int32)], color(rng), cv2.LINE_AA)
    pale = (250, 248, 240)
    cv2.rectangle(image, (0, 0), (179, 46), shift(ground, -0.6), -1)
    word = "".join("ABCDEFGHIKLMNOPRSTUVWZ"[i] for i in rng.integers(0, 22, 6))
    cv2.putText(image, word, (10, 35), cv2.FONT_HERSHEY_DUPLEX, 1.25, pale, 3, cv2.LINE_AA)
    cv2.rectangle(image, (0, 192), (179, 239), pale, -1)
    for y in range(200, 236, 8):
        cv2.line(image, (10, y), (int(rng.integers(80, 172)), y), (60, 60, 70), 2)
    cv2.rectangle(image, (0, 0), (179, 239), pale, 5)
    return image


def board(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Paint a whiteboard on its stand [190, 160, 4]: notes, boxes and curves."""
    image = clear(190, 160, (120, 124, 128))
    for x in (16, 140):
        cv2.rectangle(image, (x, 100), (x + 5, 182), ink((108, 112, 116)), -1)
        cv2.rectangle(image, (x - 12, 181), (x + 17, 189), ink((60, 62, 66)), -1)
    cv2.rectangle(image, (0, 0), (159, 122), ink((150, 154, 158)), -1)
    cv2.rectangle(image, (5, 5), (154, 116), ink((244, 246, 246)), -1)
    for _ in range(int(rng.integers(5, 10))):
        pen = ink(((20, 40, 150), (180, 30, 36), (30, 30, 34), (20, 120, 60))[rng.integers(4)])
        x, y = int(rng.integers(12, 110)), int(rng.integers(16, 96))
        pick = rng.integers(4)
        if pick == 0:
            cv2.rectangle(image, (x, y), (x + int(rng.integers(12, 38)), y + int(rng.integers(8, 20))), pen, 2)
        elif pick == 1:
            formula = f"{rng.integers(9)}x+{rng.integers(99)}"
            cv2.putText(image, formula, (x, y + 6), cv2.FONT_HERSHEY_SIMPLEX, 0.45, pen, 2)
        elif pick == 2:
            xs = np.arange(0, 44, 3)
            ys = y + 8 * np.sin(xs * rng.uniform(0.1, 0.4))
            cv2.polylines(image, [np.stack([x + xs, ys], axis=1).astype(np.int32)], False, pen, 2)
        else:
            cv2.arrowedLine(image, (x, y), (x + int(rng.integers(-10, 36)), y + int(rng.integers(-8, 16))), pen, 2)
    image[:122, :, 3] = 255  # smoothed letters leave pinholes
    return image


def barrier(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Paint a road barrier [110, 220, 4]: striped boards on legs, a lamp on top."""
    first: Color = ((206, 36, 32), (240, 130, 20), (30, 30, 30))[rng.integers(3)]
    second: Color = (244, 244, 240) if first[0] > 40 else (244, 200, 30)
    image = clear(110, 220, shift(first, -0.2))
    for x in (22, 188):
        cv2.rectangle(image, (x, 10), (x + 10, 106), ink((110, 112, 114)), -1)
        cv2.rectangle(image, (x - 16, 100), (x + 26, 109), ink((60, 60, 62)), -1)
    stripes = (np.add.outer(np.arange(110), np.arange(220)) // 22) % 2 == 0
    colors = np.where(stripes[..., None], np.array([*first, 255.0]), np.array([*second, 255.0]))
    for y0, y1 in ((14, 46), (60, 84)):
        image[y0:y1] = colors[y0:y1]
    cv2.circle(image, (27, 8), 7, ink((250, 170, 30)), -1)
    return image


def table_front(legs: Color) -> NDArray[np.uint8]:
    """Paint the legs and frame of a table [72, 140, 4]."""
    image = clear(72, 140, legs)
    cv2.rectangle(image, (0, 0), (139, 9), ink(legs), -1)
    for x in (3, 129):
        cv2.rectangle(image, (x, 0), (x + 7, 71), ink(shift(legs, -0.2)), -1)
    cv2.line(image, (6, 54), (132, 54), ink(shift(legs, -0.3)), 4)
    return image


def table_top(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Paint a table's top [100, 160, 3] with papers on it."""
    image = np.full((100, 160, 3), np.rint(shift(color(rng), 0.1)), np.uint8)
    for _ in range(int(rng.integers(3, 8))):
        x, y = int(rng.integers(4, 130)), int(rng.integers(4, 76))
        cv2.rectangle(image, (x, y), (x + int(rng.integers(12, 30)), y + int(rng.integers(8, 22))), color(rng), -1)
    cv2.rectangle(image, (0, 0), (159, 99), (70, 60, 52), 3)
    return image
