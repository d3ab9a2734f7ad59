"""The light of a session, outdoors and under the lamps of the passage, and what the camera makes of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus.scene import Mesh


@dataclass(frozen=True)
class Light:
    """Sun, sky and camera of a session; colours are factors of RGB."""

    azimuth: float  # radians: where the sun stands
    elevation: float  # radians
    sun: tuple[float, float, float]
    ambient: tuple[float, float, float]
    zenith: tuple[float, float, float]  # colour of the sky above, 0..255
    horizon: tuple[float, float, float]  # colour of the sky at the horizon, 0..255
    clouds: float  # share of the sky
    exposure: float
    balance: tuple[float, float, float]  # white balance
    gamma: float
    noise: float  # standard deviation at mid grey, grey levels
    haze: float  # metres in which half of a thing's contrast is lost

    @property
    def direction(self) -> NDArray[np.float64]:
        """Unit vector [3] to the sun."""
        c = np.cos(self.elevation)
        return np.array([c * np.cos(self.azimuth), c * np.sin(self.azimuth), np.sin(self.elevation)])


METERED = 118.0  # grey levels: a scene of this mean is exposed as the session's light says
_FINE = 16  # entries of the tone curve per grey level


LAMPS = np.array([0.93, 0.90, 0.82])  # indoors: factors of RGB on a wall, the same in every session


def gains(mesh: Mesh, light: Light, eye: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the light [Q, 3] on each quad's visible side, seen from ``eye`` [3]."""
    side = np.sign(((eye - mesh.origin) * mesh.normal).sum(1, keepdims=True))
    normal = mesh.normal * np.where(mesh.two_sided[:, None], side, 1.0)
    facing = np.clip(normal @ light.direction, 0, 1)
    share = np.where(mesh.lit, facing, 0.62)[:, None]
    sky = np.where(mesh.lit, 0.85 + 0.15 * normal[:, 2], 0.9)[:, None]
    outdoors = np.array(light.ambient) * sky + np.array(light.sun) * share
    # The lamps hang under the ceiling: tables are brighter than walls, and walls differ a little by where they face.
    under = np.where(mesh.lit, 1.0 + 0.08 * normal[:, 2] + 0.05 * normal[:, 0], 1.0)[:, None]
    return np.where(mesh.indoor[:, None], LAMPS * under, outdoors)


def _curve(gamma: float) -> NDArray[np.float32]:
    """Return the camera's tone curve [512 · _FINE] over incoming light of 0..512; 255 is white."""
    light = (np.arange(512 * _FINE) + 0.5) / _FINE
    # A soft shoulder keeps bright walls from burning out.
    soft = np.where(light > 200, 255 - 55 * np.exp((200 - light) / 55), light)
    return (255 * (soft / 255) ** gamma).astype(np.float32)


def photograph(
    color: NDArray[np.uint8], depth: NDArray[np.float32], light: Light, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """Turn what stands before the camera into an image of it.

    Args:
        color: [H, W, 3] RGB.
        depth: [H, W] metres, inf in the sky.
        light: of the session.
        rng: of the image: exposure and sensor noise.

    Returns:
        [H, W, 3] RGB.
    """
    height, width = depth.shape
    image = color.astype(np.float32)
    horizon = np.array(light.horizon, np.float32)
    with np.errstate(invalid="ignore"):
        clear = np.where(np.isinf(depth), np.float32(1), np.exp2(-depth / np.float32(light.haze)))[..., None]
    image -= horizon
    image *= clear
    image += horizon
    # The camera meters what it sees, halfway: out of a dark passage the snow outside comes out white.
    metered = float(np.clip((METERED / image.mean()) ** 0.5, 0.75, 1.35))
    gain = light.exposure * metered * float(np.exp(rng.normal(0, 0.05)))
    balance = np.array(light.balance) * np.exp(rng.normal(0, 0.012, 3))
    x = (np.arange(width, dtype=np.float32) + 0.5) / width - 0.5
    y = (np.arange(height, dtype=np.float32) + 0.5) / height - 0.5
    vignette = 1 - 0.28 * (x[None] ** 2 + y[:, None] ** 2)
    image *= (_FINE * gain * balance).astype(np.float32) * vignette[..., None]
    index = np.clip(image, 0, 512 * _FINE - 1, out=image).astype(np.int16)
    image = _curve(light.gamma).take(index)
    grain = rng.standard_normal(image.shape, dtype=np.float32)
    grain *= image * np.float32(light.noise * 0.4 / 128) + np.float32(light.noise * 0.6)
    image += grain
    return np.clip(np.rint(image, out=image), 0, 255, out=image).astype(np.uint8)
