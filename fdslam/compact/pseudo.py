"""Changes made up for training: foreign patches pasted into a map image, and another light."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.types import Image

PATCHES = 4  # most that are pasted into an image
AREA = (0.005, 0.10)  # of a patch, share of the image, log-uniform
ASPECT = 2.5  # most that a patch is wider than high, or higher than wide
FEATHER = (0.0, 0.01)  # σ of its soft border, share of √(height · width)
LIGHT, GAMMA, COLOUR = 0.7, 0.6, 0.2  # most of another light, as logarithms
HAZE, NOISE = 0.5, 8.0  # most of a veil of light, share; of noise, σ in grey levels
SHARP = 0.3  # pixels: below this σ a border is not softened
BLURRED = 0.3  # share of the images that are out of focus
Mask = NDArray[np.float32]  # [H, W] share of each pixel that is foreign, 0 … 1


def pseudo_query(image: Image, foreign: Sequence[Image], rng: np.random.Generator) -> tuple[Image, Mask]:
    """Return an image in another light with patches of foreign ones pasted in.

    Args:
        image: uint8 RGB [H, W, 3].
        foreign: images of other places that patches are cut from; none: the light alone changes.
        rng: decides everything.

    Returns:
        The image, and which share of each pixel is foreign.
    """
    result, mask = image.astype(np.float32), np.zeros(image.shape[:2], np.float32)
    for _ in range(rng.integers(0, PATCHES + 1) if len(foreign) else 0):
        patch = _patch(foreign[int(rng.integers(len(foreign)))], image.shape[:2], rng)
        if patch is None:
            continue
        soft, pixels, top, left = patch
        part = np.s_[top : top + soft.shape[0], left : left + soft.shape[1]]
        result[part] += soft[..., None] * (pixels - result[part])
        mask[part] = np.maximum(mask[part], soft)
    return _other_light(result, rng), mask


def _patch(
    foreign: Image, size: tuple[int, int], rng: np.random.Generator
) -> tuple[Mask, NDArray[np.float32], int, int] | None:
    """Return a patch's soft shape, its pixels, and where it goes; None where the foreign image is too small for it."""
    height, width = size
    area = math.exp(rng.uniform(*np.log(AREA))) * height * width
    aspect = math.exp(rng.uniform(-1, 1) * math.log(ASPECT))
    h, w = round(math.sqrt(area / aspect)), round(math.sqrt(area * aspect))
    h, w = min(max(h, 4), height), min(max(w, 4), width)
    scale = math.exp(rng.uniform(-0.5, 0.5))  # of the texture
    from_h, from_w = min(round(h * scale), foreign.shape[0]), min(round(w * scale), foreign.shape[1])
    if min(from_h, from_w) < 2:
        return None
    y, x = (int(rng.integers(0, n - m + 1)) for n, m in ((foreign.shape[0], from_h), (foreign.shape[1], from_w)))
    pixels = cv2.resize(foreign[y : y + from_h, x : x + from_w], (w, h), interpolation=cv2.INTER_LINEAR)
    gain, shift = rng.uniform(0.7, 1.3), rng.uniform(-20, 20)
    shape = _shape(h, w, rng)
    sigma = rng.uniform(*FEATHER) * math.sqrt(height * width)
    if sigma > SHARP:
        shape = np.asarray(cv2.GaussianBlur(shape, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT))
    top, left = int(rng.integers(0, height - h + 1)), int(rng.integers(0, width - w + 1))
    return shape, np.clip(pixels * gain + shift, 0, 255).astype(np.float32), top, left


def _shape(h: int, w: int, rng: np.random.Generator) -> Mask:
    """Return a rectangle, ellipse, polygon or trapezium that fills most of its box, float32 [h, w]."""
    shape = np.zeros((h, w), np.float32)
    kind = rng.integers(4)
    if kind == 0:
        shape[:] = 1
    elif kind == 1:
        cv2.ellipse(shape, (w // 2, h // 2), (max(w // 2, 1), max(h // 2, 1)), 0, 0, 360, 1.0, -1)
    elif kind == 2:
        angle = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(5, 10)))
        radius = rng.uniform(0.7, 1.0, len(angle))
        corners = np.stack([w / 2 * (1 + radius * np.cos(angle)), h / 2 * (1 + radius * np.sin(angle))], axis=1)
        cv2.fillPoly(shape, [corners.astype(np.int32)], 1.0)
    else:
        inset = rng.uniform(0, 0.3, 2) * w
        corners = np.array([[inset[0], 0], [w - 1 - inset[1], 0], [w - 1, h - 1], [0, h - 1]])
        cv2.fillPoly(shape, [corners.astype(np.int32)], 1.0)
    return shape


def _other_light(image: NDArray[np.float32], rng: np.random.Generator) -> Image:
    """Return an image (float32 [H, W, 3], 0 … 255) with another exposure, gamma, colour, sharpness and compression."""
    strength = rng.uniform(0, 1)  # of all of it together: some images look as they did, some hardly
    gain, gamma = (math.exp(strength * rng.uniform(-log, log)) for log in (LIGHT, GAMMA))
    colour = np.exp(strength * rng.uniform(-COLOUR, COLOUR, 3))
    haze = strength * rng.uniform(0, HAZE)
    lit = 255 * np.clip(image / 255, 0, 1) ** gamma * gain * colour
    lit = (1 - haze) * lit + haze * rng.uniform(60, 220)
    if rng.random() < BLURRED:
        lit = np.asarray(cv2.GaussianBlur(lit, (0, 0), rng.uniform(0.5, 1.2)))
    noisy = lit + strength * rng.normal(0, rng.uniform(0, NOISE), lit.shape)
    quality = int(rng.integers(60, 96))
    whole = np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
    _, packed = cv2.imencode(".jpg", whole[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.ascontiguousarray(np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR))[..., ::-1])
