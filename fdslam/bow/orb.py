"""ORB keypoints and 256-bit descriptors, spread over the image by a grid (§FD).

OpenCV's ORB keeps the strongest corners wherever they are, so that a textured facade takes them all and many OBBs are
left empty. Here it proposes several times as many, and the cells of a grid take turns in keeping their strongest.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.config import Orb
from fdslam.data.images import enlarge
from fdslam.types import Features, Image

PROPOSED = 8  # times the wanted number of features, before the grid chooses
NOTHING = Features(np.zeros((0, 2), np.float32), np.zeros((0, 32), np.uint8))


def take_turns(cell: NDArray[np.int64], response: NDArray[np.float32], wanted: int) -> NDArray[np.int64]:
    """Choose ``wanted`` items so that cells take turns: first the best of every cell, then every second best, …

    Args:
        cell: int [n], the grid cell of each item.
        response: float32 [n], larger is better.
        wanted: how many to keep; all are kept if there are fewer.

    Returns:
        int64 indices of the chosen items, in ascending order. Equal responses go by index.
    """
    order = np.lexsort((-response, cell))
    sorted_cell = cell[order]
    first = np.r_[True, sorted_cell[1:] != sorted_cell[:-1]]
    turn = np.arange(len(cell)) - np.maximum.accumulate(np.where(first, np.arange(len(cell)), 0))
    best = order[np.lexsort((order, -response[order], turn))]
    return np.sort(best[:wanted])


def extract(image: Image, config: Orb) -> Features:
    """Return the ORB features of an image (uint8 RGB [H, W, 3]); there may be none (a blank wall)."""
    height, width = image.shape[:2]
    grey, stretch = enlarge(np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8), config.min_side)
    spread = config.grid > 0
    wanted = config.features * (PROPOSED if spread else 1)
    orb = cv2.ORB.create(nfeatures=wanted, fastThreshold=config.fast_threshold)
    keypoints = orb.detect(grey, None)
    if not keypoints:
        return NOTHING
    if spread:
        xy = _positions(keypoints)
        # About grid² cells, as square as the image allows.
        side = np.sqrt(grey.shape[0] * grey.shape[1]) / config.grid
        columns = int(np.ceil(grey.shape[1] / side))
        cell = (xy[:, 1] // side).astype(np.int64) * columns + (xy[:, 0] // side).astype(np.int64)
        response = np.array([k.response for k in keypoints], np.float32)
        keypoints = [keypoints[i] for i in take_turns(cell, response, config.features)]
    keypoints, descriptors = orb.compute(grey, keypoints)
    if descriptors is None:
        return NOTHING
    # OpenCV counts from the centre of the first pixel, this project from its corner.
    xy = (_positions(keypoints) + np.float32(0.5)) / stretch
    last = np.nextafter(np.array([width, height], np.float32), np.float32(0))
    return Features(np.clip(xy, 0, last).astype(np.float32), np.asarray(descriptors, np.uint8))


def _positions(keypoints: Sequence[cv2.KeyPoint]) -> NDArray[np.float32]:
    """Return float32 [n, 2]."""
    return np.array(cv2.KeyPoint.convert(keypoints), np.float32).reshape(-1, 2)
