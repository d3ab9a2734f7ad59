"""Masks of change: what their colours mean, and the boxes of the areas that have changed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.data.images import read_image
from fdslam.errors import InputError
from fdslam.types import Frame, Image

Changed = NDArray[np.bool_]  # [H, W]
BLACK, WHITE = 0x000000, 0xFFFFFF
CHANGESIM = {  # colour -> class, of change_segmentation: github.com/SAMMiCA/ChangeSim, script/utils
    0x000000: "static",
    0x512600: "new",
    0x292484: "missing",
    0x193010: "rotated",
    0x83C00D: "replaced",
}
_SHOWN = 6  # values named in a message


def _codes(mask: Image) -> NDArray[np.int32]:
    """Return each pixel's colour as one number, 0xRRGGBB."""
    red, green, blue = (mask[..., i].astype(np.int32) for i in range(3))
    return (red << 16) | (green << 8) | blue


def _refuse(path: Path, found: NDArray[np.int32], needed: str) -> InputError:
    grey = all(code % 0x10101 == 0 for code in found.tolist())
    names = [str(code // 0x10101) if grey else f"#{code:06x}" for code in found[:_SHOWN].tolist()]
    rest = f" and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
    blurred = "; JPEG blurs a mask: save it as PNG" if path.suffix.lower() in (".jpg", ".jpeg") else ""
    return InputError(
        f"{path}: holds {'the values' if grey else 'the colours'} {', '.join(names)}{rest}; {needed}{blurred}"
    )


def _white(mask: Image, path: Path) -> Changed:
    """White has changed: 0 and 255, or 0 and 1, and nothing else."""
    grey = mask[..., 0]
    values = set(np.flatnonzero(np.bincount(grey.ravel())).tolist())
    if not (values <= {0, 255} or values <= {0, 1}) or (mask != grey[..., None]).any():
        raise _refuse(path, np.unique(_codes(mask)), "a mask of change holds 0 and 255, or 0 and 1")
    return grey != 0


def _black(mask: Image, path: Path) -> Changed:
    return ~_white(mask, path)


def _coloured(mask: Image, path: Path) -> Changed:
    """VL-CMU-CD as released: colours are classes of change; black is none, and so is white, the sky."""
    codes = _codes(mask)
    return (codes != BLACK) & (codes != WHITE)


def _nonzero(mask: Image, path: Path) -> Changed:
    return (mask != 0).any(axis=2)


def _changesim(mask: Image, path: Path) -> Changed:
    codes = _codes(mask)
    if not np.isin(codes, list(CHANGESIM)).all():
        classes = ", ".join(f"#{code:06x} {name}" for code, name in CHANGESIM.items())
        raise _refuse(path, np.setdiff1d(codes, list(CHANGESIM)), f"a mask of ChangeSim holds {classes}")
    return codes != BLACK


READINGS: dict[str, Callable[[Image, Path], Changed]] = {
    "white": _white,
    "black": _black,
    "coloured": _coloured,
    "nonzero": _nonzero,
    "changesim": _changesim,
}


def read_mask(path: Path, frame: Frame, reading: str) -> Changed:
    """Return which pixels of ``frame`` have changed: bool [H, W].

    Args:
        path: the mask, any image of at most 8 bit a channel.
        frame: the image that it belongs to.
        reading: a key of ``READINGS``.

    Raises:
        InputError: unreadable, of another size than its image, or with values that the reading does not know.
    """
    mask = read_image(path)
    height, width = mask.shape[:2]
    if (height, width) != (frame.height, frame.width):
        raise InputError(
            f"{path}: the mask is {width}×{height} pixels, its image {frame.name} {frame.width}×{frame.height}; "
            "they must be the same"
        )
    return READINGS[reading](mask, path)


def areas(changed: Changed, min_area: int) -> NDArray[np.float32]:
    """Return the boxes of the connected areas (8 neighbours), from top to bottom: float32 [n, 4] xyxy, pixels.

    Args:
        changed: bool [H, W].
        min_area: pixels; smaller areas are no object.
    """
    _, _, stats, _ = cv2.connectedComponentsWithStats(changed.astype(np.uint8), connectivity=8)
    left, top, width, height, area = stats[1:].T
    boxes = np.stack([left, top, left + width, top + height], axis=1)[area >= min_area]
    return boxes[np.lexsort(boxes.T[[3, 2, 0, 1]])].astype(np.float32)
