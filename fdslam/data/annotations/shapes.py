"""The box that encloses a shape. Whatever is no number or has no extent is a ValueError that says which."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from fdslam.data.annotations.annotation import XYXY, finite


def corners(x0: float, y0: float, x1: float, y1: float) -> XYXY:
    """Return the box with these corners, which must be in order."""
    x0, y0, x1, y1 = finite(x0, y0, x1, y1)
    if not (x0 < x1 and y0 < y1):
        raise ValueError("it is empty")
    return x0, y0, x1, y1


def points(of: Iterable[Sequence[float]]) -> XYXY:
    """Return the box around points (x, y)."""
    flat = [_point(point) for point in of]
    if not flat:
        raise ValueError("it has no points")
    xs, ys = zip(*flat, strict=True)
    return corners(min(xs), min(ys), max(xs), max(ys))


def _point(value: Sequence[float]) -> list[float]:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise ValueError(f"{value!r} is no point x, y")
    return finite(*value)


def circle(centre: Sequence[float], rim: Sequence[float]) -> XYXY:
    """Return the box around the circle through ``rim``."""
    x, y = _point(centre)
    radius = math.dist((x, y), _point(rim))
    return corners(x - radius, y - radius, x + radius, y + radius)


def rotated_box(box: XYXY, degrees: float) -> XYXY:
    """Return the box around ``box`` turned about its centre."""
    x0, y0, x1, y1 = corners(*box)
    [angle] = map(math.radians, finite(degrees))
    half_w, half_h = (x1 - x0) / 2, (y1 - y0) / 2
    across = abs(half_w * math.cos(angle)) + abs(half_h * math.sin(angle))
    down = abs(half_w * math.sin(angle)) + abs(half_h * math.cos(angle))
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    return box if degrees == 0 else corners(x - across, y - down, x + across, y + down)


def rotated_ellipse(centre: Sequence[float], radii: Sequence[float], degrees: float) -> XYXY:
    """Return the box around an ellipse with half axes ``radii`` turned about its centre."""
    (x, y), (a, b) = finite(*centre), finite(*radii)
    [angle] = map(math.radians, finite(degrees))
    across = math.hypot(a * math.cos(angle), b * math.sin(angle))
    down = math.hypot(a * math.sin(angle), b * math.cos(angle))
    return corners(x - across, y - down, x + across, y + down)
