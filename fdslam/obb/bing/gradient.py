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

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

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


def _normed(image: NDArray[np.uint8], along: Callable[[list[NDArray[np.uint8]]], NDArray[np.uint8]]) -> Gradient:
    planes = [np.asarray(plane, np.uint8) for plane in cv2.split(image)]
    rows = along(planes)
    columns = along([np.ascontiguousarray(plane.T) for plane in planes])
    return np.asarray(cv2.add(rows, np.ascontiguousarray(columns.T)), np.uint8)  # saturates


def _maxbgr(image: Image) -> Gradient:
    return _normed(image, _largest)


def _hsv(image: Image) -> Gradient:
    return _normed(np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2HSV), np.uint8), _summed)


def _grey(image: Image) -> Gradient:
    return _normed(np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8), _largest)


SPACES: dict[str, Callable[[Image], Gradient]] = {"maxbgr": _maxbgr, "hsv": _hsv, "grey": _grey}


def normed_gradient(image: Image, space: str) -> Gradient:
    """Return the normed gradient, uint8 [H, W], of an image (uint8 RGB [H, W, 3]) in a colour space of SPACES."""
    return SPACES[space](image)
