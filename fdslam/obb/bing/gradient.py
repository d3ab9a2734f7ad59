"""Normed gradients: how much the image changes around a pixel, min(|Ix| + |Iy|, 255), in three colour spaces.

Ix is the difference of the two neighbours in the row, Iy of those in the column; a pixel at the border has one
neighbour and its own value. The three spaces measure a difference, and scale it, as the published filters were trained:

- maxbgr: the channel that differs most; at the border twice the difference;
- grey: the brightness alone; at the border twice the difference;
- hsv: the sum over hue (0..179, not taken round the circle), saturation and value; inside half of it, rounded down.

Source: Cheng et al., BING: Binarized Normed Gradients for Objectness Estimation at 300 fps, CVPR 2014, and the code
published with it.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.native import NATIVE, njit
from fdslam.types import Image

Gradient = NDArray[np.uint8]  # [H, W]


def _apart(plane: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return |f(x + 1) - f(x - 1)| along rows, uint8 [H, W]; in the outer columns the difference to the only neighbour.

    A single column differs from nothing.
    """
    out = np.zeros_like(plane)
    if plane.shape[1] > 2:
        out[:, 1:-1] = cv2.absdiff(plane[:, 2:], plane[:, :-2])
    if plane.shape[1] > 1:
        out[:, :1] = cv2.absdiff(plane[:, 1:2], plane[:, :1])
        out[:, -1:] = cv2.absdiff(plane[:, -1:], plane[:, -2:-1])
    return out


def _largest(planes: list[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Return |Ix| of the plane that differs most, at most 255: more makes no difference to the sum."""
    out = _apart(planes[0])
    for plane in planes[1:]:
        cv2.max(out, _apart(plane), dst=out)
    for edge in (out[:, :1], out[:, -1:]):
        edge[:] = np.minimum(edge, 127) * 2 + (edge > 127)
    return out


def _summed(planes: list[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Return |Ix| summed over the planes, inside halved, at most 255."""
    total = np.zeros(planes[0].shape, np.uint16)
    for plane in planes:
        total += _apart(plane)
    total[:, 1:-1] //= 2
    return np.minimum(total, 255).astype(np.uint8)


def _by_arrays(values: NDArray[np.uint8], summed: bool, out: Gradient) -> None:
    """Write the normed gradient of an image in its colour space, [H, W, channels], to ``out``."""
    along = _summed if summed else _largest
    planes = [np.ascontiguousarray(values[..., channel]) for channel in range(values.shape[2])]
    columns = along([np.ascontiguousarray(plane.T) for plane in planes])
    out[...] = np.asarray(cv2.add(along(planes), np.ascontiguousarray(columns.T)), np.uint8)  # saturates


@njit
def _by_loops(values, summed, out):
    """Write the same, by compiled loops."""
    height, width, channels = values.shape
    for y in range(height):
        above, below = max(y - 1, 0), min(y + 1, height - 1)
        for x in range(width):
            left, right = max(x - 1, 0), min(x + 1, width - 1)
            across = down = np.int64(0)
            for channel in range(channels):
                dx = abs(np.int64(values[y, right, channel]) - np.int64(values[y, left, channel]))
                dy = abs(np.int64(values[below, x, channel]) - np.int64(values[above, x, channel]))
                if summed:
                    across += dx
                    down += dy
                else:
                    across, down = max(across, dx), max(down, dy)
            edge_x, edge_y = x == 0 or x == width - 1, y == 0 or y == height - 1
            if summed:
                across //= 1 if edge_x else 2
                down //= 1 if edge_y else 2
            else:
                across *= 2 if edge_x else 1
                down *= 2 if edge_y else 1
            out[y, x] = min(across + down, 255)


# The code that turns an image into the values of a space, and whether differences are summed over its channels.
SPACES: dict[str, tuple[int | None, bool]] = {
    "maxbgr": (None, False),
    "hsv": (cv2.COLOR_RGB2HSV, True),
    "grey": (cv2.COLOR_RGB2GRAY, False),
}


def normed_gradient(image: Image, space: str) -> Gradient:
    """Return the normed gradient, uint8 [H, W], of an image (uint8 RGB [H, W, 3]) in a colour space of SPACES."""
    code, summed = SPACES[space]
    values = image if code is None else np.asarray(cv2.cvtColor(image, code), np.uint8)
    out = np.empty(image.shape[:2], np.uint8)
    measure = _by_loops if NATIVE else _by_arrays
    measure(np.ascontiguousarray(values.reshape(*out.shape, -1)), summed, out)
    return out
