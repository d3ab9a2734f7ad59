"""Leaves, bark and hedges, in the colours of a season."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus.texture import Color, noise, to_bytes


@dataclass(frozen=True)
class Season:
    """What the plants look like in a session."""

    leaves: tuple[Color, ...]  # a tree takes one
    density: float  # share of the crown that is full of leaves
    grass: Color
    litter: float  # fallen leaves per square metre near the path


SUMMER = Season(((92, 138, 58), (72, 118, 52), (112, 150, 70), (84, 126, 76)), 1.0, (112, 142, 74), 0.0)
AUTUMN = Season(((196, 132, 48), (178, 92, 42), (150, 140, 60), (206, 164, 70)), 0.55, (132, 136, 78), 0.7)


def crown(rng: np.random.Generator, color: Color, density: float, size: int = 288) -> NDArray[np.uint8]:
    """Paint a tree crown [size, size, 4]: clumps of leaves, dark inside and below, with holes between."""
    image = np.zeros((size, size, 4), np.uint8)
    base = np.array(color)
    image[..., :3] = np.rint(base * 0.62)
    clumps = int(26 * (0.5 + 0.5 * density))
    angle, reach = rng.uniform(0, 2 * np.pi, clumps), np.sqrt(rng.uniform(0, 1, clumps)) * 0.33 * size
    center = np.stack([size / 2 + reach * np.cos(angle), size / 2 + reach * np.sin(angle)], axis=1)
    n = int(2300 * density + 300)
    which = rng.integers(0, clumps, n)
    spread = rng.normal(0, 0.062 * size, (n, 2))
    xy = np.clip(center[which] + spread, 5, size - 6)
    light = 0.72 - 0.9 * spread[:, 1] / (0.2 * size) + rng.normal(0, 0.16, n) - 0.25 * (center[which, 1] / size - 0.5)
    hue = rng.normal(1, 0.07, (n, 3))
    for k in np.argsort(light):
        tint = np.clip(base * hue[k] * (0.45 + 0.6 * np.clip(light[k], 0, 1.3)), 0, 255)
        axes = int(rng.integers(3, 8)), int(rng.integers(2, 5))
        point = int(xy[k, 0]), int(xy[k, 1])
        cv2.ellipse(image, point, axes, float(rng.uniform(0, 180)), 0, 360, (*tint.tolist(), 255), -1)
    for k in range(clumps if density < 0.9 else 0):  # branches show where leaves are few
        end = int(center[k, 0]), int(center[k, 1])
        cv2.line(image, (size // 2, size - 4), end, (74, 60, 48, 255), 2)
    return image


def bark(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Paint bark [128, 32, 3]."""
    tone = 1 + 0.35 * noise(rng, 128, 32, 18, 2)
    tone *= rng.uniform(0.8, 1.1, (1, 32)).astype(np.float32) * np.linspace(0.7, 1.2, 32, dtype=np.float32)
    return to_bytes(tone[..., None] * np.array((98, 82, 66), np.float32))


def hedge(rng: np.random.Generator, color: Color, height: int = 96, width: int = 384) -> NDArray[np.uint8]:
    """Paint a clipped hedge [height, width, 3]."""
    image = np.zeros((height, width, 3), np.uint8)
    image[:] = np.rint(np.array(color) * 0.45)
    n = height * width // 14
    xs, ys = rng.integers(0, width, n), rng.integers(0, height, n)
    tone = rng.uniform(0.5, 1.15, n) * (1.1 - 0.5 * ys / height)
    turns = rng.uniform(0, 180, n)
    for x, y, t, a in zip(xs.tolist(), ys.tolist(), tone.tolist(), turns.tolist(), strict=True):
        cv2.ellipse(image, (x, y), (4, 2), a, 0, 360, tuple(min(255.0, c * t) for c in color), -1)
    return image
