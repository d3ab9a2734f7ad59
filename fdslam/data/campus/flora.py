"""Leaves, boughs, bark and hedges, in the colours of a season."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus.texture import Color, noise, to_bytes

SNOW: Color = (238, 242, 248)
_WOOD: Color = (84, 70, 58)
_SIZE = 288  # pixels: side of a crown
Limb = tuple[NDArray[np.float64], NDArray[np.float64], int]  # from, to [2] pixels, width in pixels


def _outside(points: NDArray[np.float64], reach: float) -> NDArray[np.float64]:
    """Return how far points [..., 2] of a crown's picture lie outside a ball of that radius, as a share of it."""
    away = (points - np.array([_SIZE / 2, 0.46 * _SIZE])) / np.array([reach, 0.95 * reach])
    out: NDArray[np.float64] = np.linalg.norm(away, axis=-1) - 1
    return out


def limbs(rng: np.random.Generator) -> list[Limb]:
    """Grow the boughs and twigs of a crown, the same in every season; thick ones first."""
    root = np.array([_SIZE / 2, _SIZE - 1.0])
    grown: list[Limb] = []
    tips = [(root, -np.pi / 2 + a, rng.uniform(0.2, 0.27) * _SIZE) for a in rng.normal((-0.5, 0.05, 0.55), 0.14)]
    for width in (9, 6, 4, 3, 2, 1):
        following = []
        for start, angle, length in tips:
            end = start + length * np.array([np.cos(angle), np.sin(angle)])
            if _outside(end, 126.0) > 0:
                continue
            grown.append((start, end, width))
            for turn in (-1, 1):
                # Twigs strive upwards, or a crown would hang.
                bent = angle + turn * rng.uniform(0.15, 0.8)
                following.append((end, bent + 0.1 * (-np.pi / 2 - bent), length * rng.uniform(0.66, 0.92)))
        tips = following
    return grown


def crown(
    boughs: list[Limb], rng: np.random.Generator, color: Color, density: float, snow: float = 0.0
) -> NDArray[np.uint8]:
    """Paint a tree crown [288, 288, 4]: boughs, and leaves about the twigs, dark inside and below, with holes between.

    Args:
        boughs: of the tree.
        rng: of the leaves.
        color: of the leaves.
        density: share of the leaves that are out; 0: bare.
        snow: share of the boughs with snow on them.
    """
    image = np.zeros((_SIZE, _SIZE, 4), np.uint8)
    base = np.array(color)
    image[..., :3] = np.rint(base * 0.62 if density else np.array(_WOOD) * 1.1)
    for start, end, width in boughs:
        a, b = (tuple(np.rint(p).astype(int).tolist()) for p in (start, end))
        wood = np.clip(np.array(_WOOD) * rng.uniform(0.8, 1.25), 0, 255).tolist()
        cv2.line(image, a, b, (*wood, 255.0), width)
        if rng.random() < snow and abs(end[0] - start[0]) > 0.5 * abs(end[1] - start[1]):
            lift = (width + 1) // 2
            cv2.line(image, (a[0], a[1] - lift), (b[0], b[1] - lift), (*SNOW, 255.0), max(1, width // 2))
    n = int(2600 * density)
    tips = np.array([end for _, end, width in boughs if width <= 4])
    which = rng.integers(0, len(tips), n)
    spread = rng.normal(0, 0.055 * _SIZE, (n, 2))
    xy = tips[which] + spread
    xy[_outside(xy, 134.0) > 0] = tips[which][_outside(xy, 134.0) > 0]
    light = 0.72 - 0.9 * spread[:, 1] / (0.2 * _SIZE) + rng.normal(0, 0.16, n) - 0.25 * (tips[which, 1] / _SIZE - 0.5)
    hue = rng.normal(1, 0.07, (n, 3))
    for k in np.argsort(light):
        tint = np.clip(base * hue[k] * (0.45 + 0.6 * np.clip(light[k], 0, 1.3)), 0, 255)
        axes = int(rng.integers(3, 8)), int(rng.integers(2, 5))
        point = int(xy[k, 0]), int(xy[k, 1])
        cv2.ellipse(image, point, axes, float(rng.uniform(0, 180)), 0, 360, (*tint.tolist(), 255), -1)
    return image


def bark(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Paint bark [128, 32, 3]."""
    tone = 1 + 0.35 * noise(rng, 128, 32, 18, 2)
    tone *= rng.uniform(0.8, 1.1, (1, 32)).astype(np.float32) * np.linspace(0.7, 1.2, 32, dtype=np.float32)
    return to_bytes(tone[..., None] * np.array((98, 82, 66), np.float32))


def bush(rng: np.random.Generator, color: Color, snow: float) -> NDArray[np.uint8]:
    """Paint a bush [288, 288, 4]: a dense ball of leaves, snow on its upper half."""
    image = np.zeros((_SIZE, _SIZE, 4), np.uint8)
    image[..., :3] = np.rint(np.array(color) * 0.62)
    n = 2400
    angle, reach = rng.uniform(0, 2 * np.pi, n), np.sqrt(rng.uniform(0, 1, n)) * 0.42 * _SIZE
    xy = np.stack([_SIZE / 2 + reach * np.cos(angle), _SIZE / 2 + reach * np.sin(angle)], axis=1)
    light = 0.75 - 0.6 * (xy[:, 1] / _SIZE - 0.5) + rng.normal(0, 0.2, n)
    for k in np.argsort(light):
        white = rng.random() < 1.4 * snow * (0.75 - xy[k, 1] / _SIZE)
        tint = SNOW if white else tuple(np.clip(np.array(color) * light[k], 0, 255).tolist())
        axes = int(rng.integers(3, 8)), int(rng.integers(2, 5))
        cv2.ellipse(image, (int(xy[k, 0]), int(xy[k, 1])), axes, float(rng.uniform(0, 180)), 0, 360, (*tint, 255.0), -1)
    return image


def hedge(rng: np.random.Generator, color: Color, snow: float, height: int = 96, width: int = 384) -> NDArray[np.uint8]:
    """Paint a clipped hedge [height, width, 3], snow along its top."""
    image = np.zeros((height, width, 3), np.uint8)
    image[:] = np.rint(np.array(color) * 0.45)
    n = height * width // 14
    xs, ys = rng.integers(0, width, n), rng.integers(0, height, n)
    tone = rng.uniform(0.5, 1.15, n) * (1.1 - 0.5 * ys / height)
    white = rng.uniform(0, 1, n) < snow * np.exp(-3.0 * ys / height)
    turns = rng.uniform(0, 180, n)
    for x, y, t, a, w in zip(xs.tolist(), ys.tolist(), tone.tolist(), turns.tolist(), white.tolist(), strict=True):
        tint = SNOW if w else tuple(min(255.0, c * t) for c in color)
        cv2.ellipse(image, (x, y), (4, 2), a, 0, 360, tint, -1)
    return image
