"""What can be learned from a query alone: how far the traces of pasting go, without any map."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from experiments.compact.learners import MadeUp, Rows
from experiments.compact.prepared import Prepared
from fdslam.compact.features import NAMES, SURROUNDINGS
from fdslam.compact.pseudo import pseudo_query
from fdslam.compact.training import DONORS, FAR
from fdslam.context import Context
from fdslam.data.images import read_image
from fdslam.types import CELL, Image, grid_shape

TEXTURE = tuple(i for i, name in enumerate(NAMES) if name.startswith("texture "))
LOOKS = ("brightness", "contrast", "gradient", "sharpness", "noise", "saturation", "redness", "blueness")


def _means(pixels: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the mean of pixels [H, W] in each cell, those at the border of what is inside."""
    rows, cols = (np.arange(0, n, CELL) for n in pixels.shape)
    sums = np.add.reduceat(np.add.reduceat(pixels.astype(np.float64), rows, axis=0), cols, axis=1)
    return sums / np.outer(np.diff(np.append(rows, pixels.shape[0])), np.diff(np.append(cols, pixels.shape[1])))


def looks(image: Image) -> list[NDArray[np.float64]]:
    """Return ``LOOKS`` of the cells of an image (uint8 RGB [H, W, 3]), [rows, cols] each."""
    colours = image.astype(np.float32)
    grey = colours.mean(axis=2)
    bright = _means(grey)
    across, down = (np.asarray(cv2.Sobel(grey, cv2.CV_32F, *which)) for which in ((1, 0), (0, 1)))
    middle = np.asarray(cv2.medianBlur(image, 3), np.float32).mean(axis=2)
    return [
        bright,
        np.sqrt(np.maximum(_means(grey**2) - bright**2, 0)),
        _means(np.hypot(across, down)),
        _means(np.abs(np.asarray(cv2.Laplacian(grey, cv2.CV_32F)))),
        _means(np.abs(grey - middle)),
        _means(colours.max(axis=2) - colours.min(axis=2)),
        _means(colours[..., 0] - grey),
        _means(colours[..., 2] - grey),
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


def redrawn(context: Context, image: int, turn: int) -> Image:
    """Return the picture that ``compact.training.pseudo_rows`` made up of a map image."""
    frames = context.dataset.map
    rng = np.random.default_rng([context.config.seed, turn, image])
    far = [m for m in range(len(frames)) if abs(m - image) > min(FAR, len(frames) // 4)]
    donors = rng.choice(far, min(DONORS, len(far)), replace=False).tolist() if far else []
    return pseudo_query(read_image(frames[image].path), [read_image(frames[m].path) for m in donors], rng)[0]


def texture_alone(rows: Rows) -> Rows:
    """Return what of early fusion's features needs no map: the density of keypoints, raw and smoothed."""
    return rows[:, TEXTURE]


def with_pixels(ready: Prepared, made: MadeUp, rows: list[Rows]) -> tuple[list[Rows], list[Rows]]:
    """Return the density of keypoints and the pixels' features of the made-up changes and of the queries."""
    context = ready.context
    a_round = len(made.image) // context.config.early.rounds
    drawn = (redrawn(context, m, i // a_round) for i, m in enumerate(made.image))
    seen = (read_image(frame.path) for frame in context.dataset.query)
    there, here = (
        [np.concatenate([texture_alone(known), pixel_rows(image)], axis=1) for known, image in zip(*pair, strict=True)]
        for pair in ((made.rows, drawn), (rows, seen))
    )
    return there, here
