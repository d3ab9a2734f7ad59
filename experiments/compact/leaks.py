"""What can be learned from a query alone: how far the traces of pasting go, without any map."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from experiments.compact.learners import MadeUp, Rows
from experiments.compact.prepared import Prepared
from fdslam.compact.features import NAMES, SURROUNDINGS
from fdslam.compact.grid import cell_means
from fdslam.compact.training import drawn, turns
from fdslam.data.images import read_image
from fdslam.types import Image, grid_shape

TEXTURE = tuple(i for i, name in enumerate(NAMES) if name.startswith("texture "))
LOOKS = ("brightness", "contrast", "gradient", "sharpness", "noise", "saturation", "redness", "blueness")


def looks(image: Image) -> list[NDArray[np.float64]]:
    """Return ``LOOKS`` of the cells of an image (uint8 RGB [H, W, 3]), [rows, cols] each."""
    colours = image.astype(np.float32)
    grey = colours.mean(axis=2)
    bright = cell_means(grey)
    across, down = (np.asarray(cv2.Sobel(grey, cv2.CV_32F, *which)) for which in ((1, 0), (0, 1)))
    middle = np.asarray(cv2.medianBlur(image, 3), np.float32).mean(axis=2)
    return [
        bright,
        np.sqrt(np.maximum(cell_means(grey**2) - bright**2, 0)),
        cell_means(np.hypot(across, down)),
        cell_means(np.abs(np.asarray(cv2.Laplacian(grey, cv2.CV_32F)))),
        cell_means(np.abs(grey - middle)),
        cell_means(colours.max(axis=2) - colours.min(axis=2)),
        cell_means(colours[..., 0] - grey),
        cell_means(colours[..., 2] - grey),
    ]


def pixel_rows(image: Image) -> Rows:
    """Return features of an image's cells that need no map: each of ``LOOKS`` in the forms of early fusion's maps.

    Returns:
        float32 [cells, 4 · len(LOOKS)]: raw, normalised within the image, smoothed at two scales.
    """
    found = []
    for cells in looks(image):
        middle = np.median(cells)
        spread = np.abs(cells - middle).mean() + 1e-6
        found += [cells, (cells - middle) / spread, *(gaussian_filter(cells, s) for s in SURROUNDINGS)]
    count = np.prod(grid_shape(image.shape[0], image.shape[1]))
    return np.stack(found, axis=-1).reshape(count, -1).astype(np.float32)


def texture_alone(rows: Rows) -> Rows:
    """Return what of early fusion's features needs no map: the density of keypoints, raw and smoothed."""
    return rows[:, TEXTURE]


def with_pixels(ready: Prepared, made: MadeUp, rows: list[Rows]) -> tuple[list[Rows], list[Rows]]:
    """Return the density of keypoints and the pixels' features of the made-up changes and of the queries."""
    context = ready.context
    pictures = (drawn(context, m, turn)[0] for turn, m in turns(len(context.dataset.map), context.config.early))
    seen = (read_image(frame.path) for frame in context.dataset.query)
    there, here = (
        [np.concatenate([texture_alone(known), pixel_rows(image)], axis=1) for known, image in zip(*pair, strict=True)]
        for pair in ((made.rows, pictures), (rows, seen))
    )
    return there, here
