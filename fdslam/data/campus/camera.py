"""The pinhole camera.

World: x east, y north, z up, metres; the ground is z = 0. A heading h looks along (cos h, sin h). Camera: X right,
Y down, Z along the optical axis. The optical axis is level and the lens is shifted (the principal point lies below the
middle), so that upright edges stay upright in the image. Pixel (i, j) is the unit square with that integer corner:
its centre is (i + 0.5, j + 0.5).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FOCAL = 0.80  # focal length / image width: 64 degrees across
HORIZON = 0.60  # principal point's height / image height
NEAR = 0.2  # metres: nothing nearer is drawn


@dataclass(frozen=True)
class Camera:
    """A level pinhole camera at a pose."""

    width: int  # pixels
    height: int  # pixels
    x: float  # metres
    y: float  # metres
    heading: float  # radians
    eye: float = 1.6  # metres above the ground

    @property
    def focal(self) -> float:
        """Focal length in pixels."""
        return FOCAL * self.width

    @property
    def center(self) -> tuple[float, float]:
        """Principal point (x, y) in pixels."""
        return 0.5 * self.width, HORIZON * self.height

    @property
    def position(self) -> NDArray[np.float64]:
        """Centre of projection [3], metres."""
        return np.array([self.x, self.y, self.eye])

    @property
    def axes(self) -> NDArray[np.float64]:
        """Rows: the world directions of right, down and forward, [3, 3]."""
        c, s = np.cos(self.heading), np.sin(self.heading)
        return np.array([[s, -c, 0.0], [0.0, 0.0, -1.0], [c, s, 0.0]])

    def matrix(self, scale: float = 1.0) -> NDArray[np.float64]:
        """Return K [3, 3] for an image of ``scale`` times the size."""
        cx, cy = self.center
        return np.array([[self.focal * scale, 0, cx * scale], [0, self.focal * scale, cy * scale], [0, 0, 1.0]])

    def to_camera(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Turn world points [..., 3] into camera coordinates [..., 3], metres."""
        return (points - self.position) @ self.axes.T

    def project(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Project world points.

        Args:
            points: [..., 3] metres, in front of the camera.

        Returns:
            Pixels [..., 2] (x, y) and depth [...] along the optical axis in metres.
        """
        p = self.to_camera(points)
        cx, cy = self.center
        xy = np.stack([self.focal * p[..., 0] / p[..., 2] + cx, self.focal * p[..., 1] / p[..., 2] + cy], axis=-1)
        return xy, p[..., 2]
