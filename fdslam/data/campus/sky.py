"""The sky: a gradient and clouds that stay where they are when the camera turns."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus.camera import Camera
from fdslam.data.campus.light import Light
from fdslam.data.campus.texture import noise

_WIDTH, _HEIGHT = 1024, 256  # the panorama: once around, and from the horizon to tan(elevation) = _TOP
_TOP = 1.6


def panorama(rng: np.random.Generator, light: Light) -> NDArray[np.uint8]:
    """Paint the sky [_HEIGHT, _WIDTH, 3] all around, the horizon at the bottom."""
    up = np.linspace(1, 0, _HEIGHT, dtype=np.float32)[:, None, None] ** 0.7
    sky = np.array(light.zenith, np.float32) * up + np.array(light.horizon, np.float32) * (1 - up)
    half = noise(rng, _HEIGHT, _WIDTH, 18, 5)
    # Blending with itself turned by half a round closes the panorama without a seam.
    blend = np.abs(np.linspace(-1, 1, _WIDTH, dtype=np.float32))
    cloud = half * (1 - blend) + np.roll(half, _WIDTH // 2, axis=1) * blend
    cover = np.clip((cloud + light.clouds - 0.45) * 2.2, 0, 1)[..., None]
    shade = np.clip(1 - 0.25 * np.roll(cover, 9, axis=0), 0, 1)
    white = np.array((250, 248, 246), np.float32) * 0.75 + np.array(light.horizon, np.float32) * 0.25
    return np.clip(sky * (1 - cover) + white * shade * cover, 0, 255).astype(np.uint8)


def view(camera: Camera, sky: NDArray[np.uint8], rows: int) -> NDArray[np.uint8]:
    """Return the upper ``rows`` of the image [rows, W, 3] filled with sky."""
    cx, cy = camera.center
    dx = (np.arange(camera.width) + 0.5 - cx) / camera.focal
    azimuth = camera.heading - np.arctan(dx)
    u = (azimuth / (2 * np.pi)) % 1.0 * _WIDTH
    rise = (cy - (np.arange(rows) + 0.5)) / camera.focal
    v = np.clip(_HEIGHT * (1 - rise[:, None] / np.sqrt(1 + dx**2) / _TOP), 0, _HEIGHT - 1)
    x = np.broadcast_to(u, v.shape).astype(np.float32)
    return np.asarray(cv2.remap(sky, x, v.astype(np.float32), cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP), np.uint8)
