"""What the passage is papered with: walls with doors and notice boards, a tiled floor, a ceiling with lamps."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus.texture import Color, noise, shift, to_bytes

DENSITY = 48  # texture pixels per metre
_PAPER: tuple[Color, ...] = ((250, 250, 246), (250, 240, 180), (206, 228, 246), (246, 206, 206), (214, 240, 206))


def _px(metres: float) -> int:
    return round(metres * DENSITY)


def daylight(length: float, width: int, reach: float = 3.0) -> NDArray[np.float32]:
    """Return how much brighter the passage is towards its two open ends, a factor [1, width, 1]."""
    x = np.linspace(0, length, width, dtype=np.float32)
    near = np.minimum(x, length - x)
    return (1 + 0.22 * np.exp(-near / np.float32(reach)))[None, :, None]


def _door(rng: np.random.Generator, image: NDArray[np.float32], x: int) -> None:
    """Draw a door with its frame, window, handle and number at column ``x``."""
    foot, w, h = image.shape[0], _px(rng.choice([0.95, 1.7])), _px(2.1)
    leaf: Color = [(158, 114, 74), (92, 112, 126), (134, 60, 52), (196, 178, 140)][rng.integers(4)]
    cv2.rectangle(image, (x - 5, foot - h - 5), (x + w + 5, foot), (108, 110, 112), -1)
    cv2.rectangle(image, (x, foot - h), (x + w, foot), leaf, -1)
    for k in range(1 if w < _px(1.2) else 2):
        left, right = x + k * w // 2, x + (w if w < _px(1.2) else (k + 1) * w // 2)
        cv2.rectangle(image, (left, foot - h), (right, foot), shift(leaf, -0.45), 1)
        if rng.random() < 0.7:
            a, b = left + (right - left) // 3, right - (right - left) // 3
            cv2.rectangle(image, (a, foot - h + 14), (b, foot - h // 2), (58, 70, 78), -1)
            cv2.rectangle(image, (a, foot - h + 14), (b, foot - h // 2), shift(leaf, -0.3), 1)
        cv2.rectangle(image, (left + 2, foot - _px(0.25)), (right - 2, foot - 3), (150, 152, 154), -1)
        cv2.line(image, (right - 8, foot - h // 2 + 6), (right - 3, foot - h // 2 + 6), (220, 220, 214), 2)
    plaque = np.full((16, 30, 3), (44, 66, 104), np.uint8)  # letters can only be drawn on bytes
    cv2.putText(plaque, f"{rng.integers(100, 140)}", (2, 13), cv2.FONT_HERSHEY_PLAIN, 0.85, (250, 250, 250), 1)
    image[foot - h + 22 : foot - h + 38, x + w + 9 : x + w + 39] = plaque


def _board(today: np.random.Generator, image: NDArray[np.float32], x: int, w: int) -> None:
    """Draw a notice board at column ``x``; its papers come and go."""
    top, bottom = _px(0.9), _px(2.0)
    cv2.rectangle(image, (x - 3, top - 3), (x + w + 3, bottom + 3), (112, 84, 58), -1)
    image[top:bottom, x : x + w] = np.array((186, 146, 98), np.float32)
    image[top:bottom, x : x + w] *= today.normal(1, 0.05, (bottom - top, w, 1)).astype(np.float32)
    for _ in range(int(w / 9)):
        a, b = int(today.integers(x + 2, x + w - 14)), int(today.integers(top + 2, bottom - 18))
        paper, size = _PAPER[today.integers(5)], (int(today.integers(8, 13)), int(today.integers(11, 17)))
        cv2.rectangle(image, (a, b), (a + size[0], b + size[1]), paper, -1)
        for line in range(b + 3, b + size[1] - 1, 3):
            cv2.line(image, (a + 2, line), (a + size[0] - int(today.integers(2, 6)), line), (92, 92, 104), 1)
        cv2.circle(image, (a + size[0] // 2, b), 1, (190, 40, 40), -1)


def _fittings(rng: np.random.Generator, image: NDArray[np.float32], x: int, w: int) -> None:
    """Draw a window to a room, a radiator, an extinguisher, a clock or a sign at column ``x``."""
    foot = image.shape[0]
    pick = rng.integers(4)
    if pick == 0:
        cv2.rectangle(image, (x, foot - _px(2.2)), (x + w, foot - _px(0.95)), (96, 100, 104), -1)
        glass = np.linspace(96, 60, _px(1.1), dtype=np.float32)[:, None, None] * np.array((0.9, 1.0, 1.05), np.float32)
        image[foot - _px(2.1) : foot - _px(2.1) + len(glass), x + 4 : x + w - 4] = glass
        for k in range(int(rng.integers(2, 6))):
            a = x + 6 + int(rng.integers(0, max(1, w - 20)))
            tint: Color = tuple(rng.uniform(40, 190, 3))
            cv2.rectangle(image, (a, foot - _px(1.0) - 4 * k - 8), (a + 10, foot - _px(1.0)), tint, -1)
    elif pick == 1:
        cv2.rectangle(image, (x, foot - _px(0.8)), (x + w, foot - _px(0.18)), (226, 224, 214), -1)
        for a in range(x, x + w, 5):
            cv2.line(image, (a, foot - _px(0.78)), (a, foot - _px(0.2)), (176, 174, 166), 1)
    elif pick == 2:
        cv2.rectangle(image, (x + 4, foot - _px(1.2)), (x + 13, foot - _px(0.72)), (196, 30, 30), -1)
        cv2.rectangle(image, (x, foot - _px(1.7)), (x + 17, foot - _px(1.36)), (200, 34, 34), -1)
        cv2.circle(image, (x + 8, foot - _px(1.53)), 4, (250, 250, 250), -1)
    else:
        cv2.circle(image, (x + 16, foot - _px(2.3)), 14, (40, 42, 46), -1)
        cv2.circle(image, (x + 16, foot - _px(2.3)), 12, (248, 248, 244), -1)
        for a in rng.uniform(0, 2 * np.pi, 2):
            end = (int(x + 16 + 9 * np.cos(a)), int(foot - _px(2.3) + 9 * np.sin(a)))
            cv2.line(image, (x + 16, foot - _px(2.3)), end, (20, 20, 20), 1)


def wall_face(rng: np.random.Generator, today: np.random.Generator, length: float, height: float) -> NDArray[np.uint8]:
    """Paint a long wall of the passage.

    Args:
        rng: of what stays.
        today: of a session: the papers on the notice boards.
        length: metres.
        height: metres.

    Returns:
        [h, w, 3] RGB, DENSITY pixels per metre.
    """
    h, w = _px(height), _px(length)
    upper: Color = [(224, 216, 196), (206, 214, 214), (220, 206, 188)][rng.integers(3)]
    lower: Color = [(132, 148, 128), (148, 112, 86), (104, 126, 146), (168, 150, 112)][rng.integers(4)]
    image = np.empty((h, w, 3), np.float32)
    image[:] = upper
    split = h - _px(rng.uniform(0.95, 1.25))
    image[split:] = lower
    # Panels of the wall differ a little, and hands and bags have left their marks.
    image *= 1 + np.float32(0.05) * noise(rng, h, w, 60, 4)[..., None]
    image[split : split + 5] = np.array((112, 84, 60), np.float32)
    for x in range(0, w, _px(2.5)):
        image[:, x : x + 1] *= 0.82
    for _ in range(int(length * 2)):
        x, y = int(rng.integers(0, w - 30)), int(rng.integers(h // 3, h - 12))
        cv2.line(image, (x, y), (x + int(rng.integers(4, 28)), y + int(rng.integers(-4, 5))), shift(lower, -0.25), 1)
    x = _px(rng.uniform(1.4, 2.2))
    while x < w - _px(3.2):
        pick, wide = rng.random(), _px(rng.uniform(1.2, 2.6))
        if pick < 0.4:
            _door(rng, image, x)
            wide = _px(2.5)
        elif pick < 0.65:
            _board(today, image, x, wide)
        else:
            _fittings(rng, image, x, wide)
        x += wide + _px(rng.uniform(0.5, 1.3))
    image[h - _px(0.12) :] = np.array((70, 72, 76), np.float32)
    image[: _px(0.08)] = np.array((176, 174, 168), np.float32)
    image *= np.linspace(1.05, 0.94, h, dtype=np.float32)[:, None, None]
    return to_bytes(image * daylight(length, w))


def floor(rng: np.random.Generator, length: float, width: float) -> NDArray[np.uint8]:
    """Paint the floor [h, w, 3], west to the left, as seen from above: tiles, mats at the ends, the lamps' sheen."""
    h, w = _px(width), _px(length)
    tone = 1 + 0.05 * noise(rng, h, w, 70, 4) + rng.normal(0, 0.02, (h, w)).astype(np.float32)
    tile = _px(0.5)
    rows, columns = -(-h // tile), -(-w // tile)
    checks = rng.normal(1, 0.05, (rows, columns)) - 0.1 * (np.add.outer(np.arange(rows), np.arange(columns)) % 2)
    tone *= checks.repeat(tile, 0).repeat(tile, 1)[:h, :w].astype(np.float32)
    tone[::tile] *= 0.8
    tone[:, ::tile] *= 0.8
    sheen = np.cos(np.linspace(0, length / 3.0 * 2 * np.pi, w, dtype=np.float32))[None]
    across = np.exp(-(np.linspace(-2, 2, h, dtype=np.float32)[:, None] ** 2))
    image = tone[..., None] * np.array((158, 152, 142), np.float32) * (1 + 0.1 * across * sheen)[..., None]
    band = _px(0.35)
    image[:band] *= np.array((0.62, 0.6, 0.62), np.float32)
    image[-band:] *= np.array((0.62, 0.6, 0.62), np.float32)
    for a, b in ((_px(0.3), _px(2.0)), (w - _px(2.0), w - _px(0.3))):
        mat = rng.normal(58, 6, (h - 4 * band, b - a)).astype(np.float32)
        mat[:, ::4] *= 0.75
        image[2 * band : -2 * band, a:b] = mat[..., None] * np.array((1.0, 1.02, 1.08), np.float32)
    return to_bytes(np.asarray(image * daylight(length, w), np.float32))


def ceiling(rng: np.random.Generator, length: float, width: float) -> NDArray[np.uint8]:
    """Paint the ceiling [h, w, 3], west to the left: panels, vents, and a lamp every three metres."""
    h, w = _px(width), _px(length)
    tone = rng.normal(1, 0.012, (h, w)).astype(np.float32)
    panel = _px(0.625)
    panels = rng.normal(1, 0.02, (-(-h // panel), -(-w // panel)))
    tone *= panels.repeat(panel, 0).repeat(panel, 1)[:h, :w].astype(np.float32)
    tone[::panel] *= 0.82
    tone[:, ::panel] *= 0.82
    image = tone[..., None] * np.array((206, 204, 196), np.float32)
    for k, x in enumerate(np.arange(1.5, length, 3.0)):
        a, b = _px(x - 0.6), _px(x + 0.6)
        cv2.rectangle(image, (a - 2, h // 2 - _px(0.17)), (b + 2, h // 2 + _px(0.17)), (150, 150, 146), -1)
        cv2.rectangle(image, (a, h // 2 - _px(0.15)), (b, h // 2 + _px(0.15)), (274, 270, 256), -1)
        if k % 2:
            y = h // 4
            cv2.rectangle(image, (a, y), (a + panel, y + panel // 2), (120, 120, 118), -1)
            for line in range(y, y + panel // 2, 4):
                cv2.line(image, (a, line), (a + panel, line), (190, 190, 186), 1)
    return to_bytes(image * daylight(length, w))
