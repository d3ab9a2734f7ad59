"""The ground: a map of what lies where, fine detail repeated over it, and the shadows on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus.camera import Camera
from fdslam.data.campus.light import Light
from fdslam.data.campus.raster import SS, Buffers
from fdslam.data.campus.scene import GROUND
from fdslam.data.campus.texture import Texture, noise, to_bytes

SIDE = 160.0  # metres covered by the map, centred on the origin; beyond it the border goes on
PIXELS = 2560
TILE = 4.0  # metres covered by a detail tile
FAR = 400.0  # metres: farther ground is lost in the horizon
PAVING, ASPHALT, GRASS = range(3)


@dataclass(frozen=True)
class Ground:
    """The ground of a session."""

    color: Texture  # [PIXELS, PIXELS, 3]
    weight: Texture  # [PIXELS, PIXELS, 3] shares of PAVING, ASPHALT and GRASS, 0..255
    shadow: Texture  # [PIXELS / 2, PIXELS / 2, 3] 255 where the sun is hidden
    detail: tuple[Texture, Texture, Texture]  # [256, 256, 3] per material; 128 leaves the colour as it is


def to_map(points: NDArray[np.float64]) -> NDArray[np.int32]:
    """Turn ground points [n, 2] in metres into map pixels (x east, y south)."""
    xy = np.stack([points[:, 0] + SIDE / 2, SIDE / 2 - points[:, 1]], axis=1)
    return np.rint(xy * PIXELS / SIDE).astype(np.int32)


def paving(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Paint slabs [256, 256, 3] of half a metre, four metres square."""
    tone = 128 * (1 + 0.1 * noise(rng, 256, 256, 40, 2)) + rng.normal(0, 7, (256, 256)).astype(np.float32)
    slabs = rng.normal(1, 0.09, (8, 8)).repeat(32, 0).repeat(32, 1)
    tone *= slabs.astype(np.float32)
    tone[::32] *= 0.6
    tone[:, ::32] *= 0.6
    tone[1::32] *= 0.85
    return to_bytes(np.repeat(tone[..., None], 3, axis=2))


def asphalt(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Paint asphalt [256, 256, 3]."""
    tone = 128 + 12 * noise(rng, 256, 256, 30, 2) + rng.normal(0, 16, (256, 256)).astype(np.float32)
    return to_bytes(np.repeat(cv2.GaussianBlur(tone, (3, 3), 0.7)[..., None], 3, axis=2))


def grass(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Paint grass blades [256, 256, 3]."""
    image = np.full((256, 256, 3), 104, np.uint8)
    xy, d = rng.integers(0, 256, (4000, 2)), rng.normal(0, 4, (4000, 2))
    tone = rng.uniform(70, 190, 4000)
    for (x, y), (dx, dy), t in zip(xy.tolist(), d.tolist(), tone.tolist(), strict=True):
        cv2.line(image, (x, y), (int(x + dx), int(y - abs(dy) - 2)), (t * 0.95, t, t * 0.8), 1)
    return image


def details(rng: np.random.Generator) -> tuple[Texture, Texture, Texture]:
    """Return the three detail tiles."""
    images = [make(rng) for make in (paving, asphalt, grass)]
    a, b, c = (Texture(lambda i=i: i) for i in images)  # type: ignore[misc]
    return a, b, c


def shadows(casters: Sequence[tuple[NDArray[np.float64], float]], light: Light) -> NDArray[np.uint8]:
    """Return where the sun is hidden [PIXELS / 2, PIXELS / 2, 3].

    Args:
        casters: convex footprints [n, 2] in metres with their heights in metres.
        light: its sun.
    """
    mask = np.zeros((PIXELS // 2, PIXELS // 2), np.uint8)
    away = -light.direction[:2] / light.direction[2]
    for foot, height in casters:
        hull = cv2.convexHull(to_map(np.concatenate([foot, foot + away * height])) // 2)
        cv2.fillConvexPoly(mask, hull, (255,), cv2.LINE_AA)
    return np.repeat(cv2.GaussianBlur(mask, (0, 0), 1.5)[..., None], 3, axis=2)


def _sample(
    texture: Texture, x: NDArray[np.float64], y: NDArray[np.float64], level: int, wrap: bool
) -> NDArray[np.float32]:
    """Return the texture [n, w, 3] at coordinates [n, w] in units of its sides."""
    image = texture.level(level, level)
    h, w = image.shape[:2]
    border = cv2.BORDER_WRAP if wrap else cv2.BORDER_REPLICATE
    u, v = (x * w - 0.5).astype(np.float32), (y * h - 0.5).astype(np.float32)
    return np.asarray(cv2.remap(image, u, v, cv2.INTER_LINEAR, borderMode=border), np.float32)


def view(camera: Camera, ground: Ground, light: Light) -> tuple[int, NDArray[np.uint8]]:
    """Return the first row of ground and the rows from there down, seen as if nothing stood on it.

    Args:
        camera: the camera.
        ground: of the session.
        light: of the session.

    Returns:
        The row, and [H - row, W, 3] RGB.
    """
    cx, cy = camera.center
    first = int(np.ceil(cy + camera.focal * camera.eye / FAR - 0.5))
    v = np.arange(first, camera.height) + 0.5
    z = camera.focal * camera.eye / (v - cy)
    dx = (np.arange(camera.width) + 0.5 - cx) / camera.focal
    axes = camera.axes
    east, north = ((camera.position[k] + z[:, None] * (axes[2, k] + dx * axes[0, k])) for k in (0, 1))  # [rows, W]
    out = np.empty((len(v), camera.width, 3), np.float32)
    # A row lies at one depth: rows are sampled in bands of like resolution. The footprint of a pixel is z / f across
    # and z² / (f · eye) in depth; their geometric mean is the compromise between blur and flicker.
    size = np.sqrt(z / camera.focal * z**2 / (camera.focal * camera.eye))
    band = np.floor(np.log2(size)).astype(int)
    lit = np.array(light.ambient) * 1.0
    sun = np.array(light.sun) * light.direction[2]
    for k in np.unique(band):
        rows = band == k
        x, y, metres = east[rows], north[rows], 2.0 ** (k + 0.5)
        level = int(max(0, round(np.log2(metres * PIXELS / SIDE))))
        fine = int(max(0, round(np.log2(metres * 256 / TILE))))
        u, w = x / SIDE + 0.5, 0.5 - y / SIDE
        color = _sample(ground.color, u, w, level, False)
        share = _sample(ground.weight, u, w, level, False) / np.float32(255)
        dark = _sample(ground.shadow, u, w, max(0, level - 1), False) / np.float32(255)
        for m, tile in enumerate(ground.detail):
            if share[..., m].any():
                texel = _sample(tile, x / TILE % 1.0, -y / TILE % 1.0, min(8, fine), True) / np.float32(128)
                color *= 1 + share[..., m : m + 1] * (texel - 1)
        out[rows] = color * (lit + sun * (1 - dark)).astype(np.float32)
    return first, to_bytes(out)


def darken(buffers: Buffers, camera: Camera, contacts: NDArray[np.float64]) -> None:
    """Darken the ground under things, in place.

    Args:
        buffers: painted with everything; only what the ground owns changes.
        camera: the camera.
        contacts: [n, 3] x, y and radius of the patches, metres.
    """
    level = np.array(buffers.label) == GROUND  # per quad: the passage's floor is ground too
    for x, y, radius in contacts:
        reach = 1.6 * radius * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        foot = np.column_stack([np.array([x, y]) + reach, np.zeros(4)])
        if camera.to_camera(foot)[:, 2].min() < 1.0:
            continue
        pixels = camera.project(foot)[0] * SS
        size = buffers.inverse.shape[::-1]
        x0, y0 = (int(np.clip(np.floor(v), 0, n)) for v, n in zip(pixels.min(0), size, strict=True))
        x1, y1 = (int(np.clip(np.ceil(v), 0, n)) for v, n in zip(pixels.max(0), size, strict=True))
        window = np.s_[y0:y1, x0:x1]
        v = (np.arange(y0, y1) + 0.5) / SS - camera.center[1]
        z = camera.focal * camera.eye / np.maximum(v, 1e-3)[:, None]
        d = z * ((np.arange(x0, x1) + 0.5) / SS - camera.center[0]) / camera.focal
        axes, position = camera.axes, camera.position
        east, north = (position[k] + z * axes[2, k] + d * axes[0, k] for k in (0, 1))
        near = ((east - x) ** 2 + (north - y) ** 2) / radius**2
        tone = np.where(level[buffers.quad[window]], 1 - 0.45 * np.exp(-(near**2)), 1.0)
        buffers.color[window] = np.rint(buffers.color[window] * tone[..., None]).astype(np.uint8)
