"""Boxes that may hold an object, of any kind, best first: both stages of BING over all window sizes.

For each size (h, w) the image is resized so that such a window has 8 × 8 pixels, stage I scores every place, the best
130 that are no neighbours of a better one go on, and stage II turns their scores into o = s · v + t, by which the
windows of all sizes (and of all colour spaces, if several are used) are ranked together. A window's box is where its
8 × 8 pixels came from. Source: Cheng et al., CVPR 2014.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.errors import InputError
from fdslam.obb.bing.binary import SIDE, Scores, binarise, score_map
from fdslam.obb.bing.filters import SIZES, Filters
from fdslam.obb.bing.gradient import normed_gradient
from fdslam.obb.bing.suppression import best_windows
from fdslam.types import Image

RADIUS = 2  # of non-maximum suppression, places on the score map
PER_SIZE = 130  # windows of one size that stage I lets through


@dataclass(frozen=True)
class Candidates:
    """What stage I lets through of one window size."""

    boxes: NDArray[np.int64]  # [n, 4] xyxy pixels, half-open, inside the image
    scores: NDArray[np.float32]  # [n] s, falling


def colour(image: NDArray) -> Image:
    """Return an image as uint8 RGB [H, W, 3]; grey ones ([H, W] or [H, W, 1]) get three equal channels.

    Raises:
        InputError: another type or shape.
    """
    if image.dtype != np.uint8 or not (image.ndim == 2 or (image.ndim == 3 and image.shape[2] in (1, 3))):
        raise InputError(
            f"BING: an image of type {image.dtype} and shape {image.shape}; it must be 8 bit, grey or RGB: convert it"
        )
    if image.ndim == 3 and image.shape[2] == 3:
        return np.ascontiguousarray(image)
    return np.repeat(image.reshape(*image.shape[:2], 1), 3, axis=2)


def resized_shape(image: Image, size: tuple[int, int]) -> tuple[int, int] | None:
    """Return (height, width) at which a window of ``size`` has 8 × 8 pixels; None if the size is left out.

    A side above twice the image's is left out; one between is cut to the image's.
    """
    if any(window > 2 * side or side == 0 for window, side in zip(size, image.shape, strict=False)):
        return None
    height, width = (round(SIDE * side / min(window, side)) for window, side in zip(size, image.shape, strict=False))
    return height, width


def resized(image: Image, shape: tuple[int, int]) -> Image:
    """Return the image resized to ``shape`` = (height, width)."""
    # Bilinear as the published filters were trained, in whole numbers: the same on every machine.
    return np.asarray(cv2.resize(image, shape[::-1], interpolation=cv2.INTER_LINEAR_EXACT), np.uint8)


def window_boxes(places: NDArray[np.int64], shape: tuple[int, int], image: Image) -> NDArray[np.int64]:
    """Return the boxes of windows, int64 [n, 4] xyxy whole pixels of the image, half-open.

    Args:
        places: int64 [n] flat indices into the score map.
        shape: (height, width) of the resized image.
        image: the image itself.
    """
    y, x = np.divmod(places, shape[1] - SIDE + 1)
    corners = np.stack([x, y, x + SIDE, y + SIDE], axis=1)
    height, width = image.shape[:2]
    return np.rint(corners * [width, height, width, height] / [shape[1], shape[0], shape[1], shape[0]]).astype(np.int64)


def candidates(
    image: Image, filters: Filters, smaller: Callable[[tuple[int, int]], Image] | None = None
) -> list[Candidates | None]:
    """Return what stage I lets through of each of ``filters.sizes``; None for a size that is left out.

    ``smaller`` gives the image at a shape, where somebody remembers what was made for another colour space.
    """
    smaller = smaller or partial(resized, image)
    beta, signs = binarise(filters.first)
    found: list[Candidates | None] = []
    for index in filters.sizes.tolist():
        shape = resized_shape(image, SIZES[index])
        if shape is None:
            found.append(None)
            continue
        scores: Scores = score_map(normed_gradient(smaller(shape), filters.space), beta, signs)
        places = best_windows(scores, RADIUS, PER_SIZE)
        found.append(Candidates(window_boxes(places, shape, image), scores.ravel()[places]))
    return found


def proposals(
    image: NDArray[np.uint8], filters: Filters | Sequence[Filters], count: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the ``count`` best boxes of an image, or as many as there are.

    A box that several sizes or colour spaces propose is named once, with its best score; ties keep the order of
    ``filters``, sizes and stage I. An image under 8 pixels on a side has none.

    Args:
        image: uint8 RGB [H, W, 3], or grey [H, W].
        filters: of one colour space or several.
        count: at most so many boxes.

    Returns:
        boxes, float32 [n, 4] xyxy whole pixels, half-open, inside the image; and their scores o, float32 [n], falling.

    Raises:
        InputError: not an 8-bit image.
    """
    rgb = colour(image)
    several = (filters,) if isinstance(filters, Filters) else filters
    smaller = cache(partial(resized, rgb))
    boxes: list[NDArray[np.int64]] = [np.empty((0, 4), np.int64)]
    scores: list[NDArray[np.float32]] = [np.empty(0, np.float32)]
    for one in several:
        for (v, t), found in zip(one.second.astype(np.float64), candidates(rgb, one, smaller), strict=True):
            if found is not None:
                boxes.append(found.boxes)
                scores.append((found.scores * v + t).astype(np.float32))
    every, score = np.concatenate(boxes), np.concatenate(scores)
    order = np.argsort(-score, kind="stable")
    order = order[_first_of_each(every[order])][:count]
    return every[order].astype(np.float32), score[order]


def _first_of_each(boxes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the rows at which a box occurs for the first time, ascending."""
    longest = boxes.max(initial=0) + 1
    corner, opposite = boxes[:, :2] @ [1, longest], boxes[:, 2:] @ [1, longest]
    order = np.lexsort((opposite, corner))  # stable
    same = (np.diff(corner[order]) == 0) & (np.diff(opposite[order]) == 0)
    return np.sort(order[np.concatenate([np.ones(min(len(order), 1), bool), ~same])])
