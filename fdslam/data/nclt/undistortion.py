"""The published tables that undistort the raw images of NCLT's cameras.

The first line holds the width and the height; then a line for each pixel of the undistorted image, ``row col src_row
src_col``: where in the raw image it comes from.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.data.images import MAX_PIXELS
from fdslam.errors import InputError
from fdslam.types import Image


@dataclass(frozen=True)
class Undistortion:
    """The maps of one camera, as cv2.remap takes them."""

    path: Path
    columns: NDArray[np.float32]  # [H, W] pixels of the raw image, a pixel's centre at whole numbers
    rows: NDArray[np.float32]  # [H, W]

    def __call__(self, raw: Image, name: Path) -> Image:
        """Return ``raw`` (uint8 [H, W, 3]) undistorted, black where nothing was seen; ``name`` is for the error.

        Raises:
            InputError: the image is not of the table's size.
        """
        if raw.shape[:2] != self.rows.shape:
            height, width = self.rows.shape
            raise InputError(
                f"{name}: is {raw.shape[1]}×{raw.shape[0]} pixels, {self.path.name} is for {width}×{height}; "
                "use the table of this camera, or dataset.undistort=false"
            )
        return np.asarray(cv2.remap(raw, self.columns, self.rows, cv2.INTER_LINEAR), np.uint8)


def read_undistortion(path: Path) -> Undistortion:
    """Read a table.

    Raises:
        InputError: no size in the first line, or not exactly one line a pixel.
    """
    try:
        with path.open(encoding="ascii") as file:
            width, height = map(int, re.findall(r"\d+", file.readline()))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: its first line must hold width and height; unpack the file again") from error
    if not 0 < width * height <= MAX_PIXELS:
        raise InputError(f"{path}: {width}×{height} pixels cannot be; unpack the file again")
    try:
        lines = np.loadtxt(path, skiprows=1, usecols=(0, 1, 2, 3), ndmin=2, max_rows=width * height + 1)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: not lines of four numbers ({error}); unpack the file again") from error
    row, column = lines[:, 0].astype(np.int64), lines[:, 1].astype(np.int64)
    inside = (row >= 0) & (row < height) & (column >= 0) & (column < width) & np.isfinite(lines[:, 2:]).all(axis=1)
    if len(lines) != width * height or not inside.all() or len(np.unique(row * width + column)) != len(lines):
        raise InputError(
            f"{path}: needs a line for each of {width}×{height} pixels, has {len(lines)}; unpack the file again"
        )
    maps = np.empty((2, height, width), np.float32)
    maps[:, row, column] = lines[:, 3:1:-1].T
    return Undistortion(path, maps[0], maps[1])
