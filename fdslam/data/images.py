"""Bounded decoding of images: nothing is decoded before its size is known to be sane, and torn files are refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image as Pillow
from PIL import ImageOps, UnidentifiedImageError

from fdslam.errors import InputError
from fdslam.types import Image

SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".webp")
MAX_PIXELS = 64_000_000  # a decoded RGB image then takes at most 192 MB
MIN_SIDE = 16  # pixels: below this no keypoint, no cell grid means anything
_EXIF_ORIENTATION, _EXIF_TRANSPOSED = 0x0112, (5, 6, 7, 8)


def _open(path: Path) -> Pillow.Image:
    try:
        return Pillow.open(path)
    except FileNotFoundError:
        raise InputError(f"{path}: no such image; check the folder or the file that lists it") from None
    except (UnidentifiedImageError, OSError, Pillow.DecompressionBombError, SyntaxError, ValueError) as error:
        raise InputError(f"{path}: not a readable image ({error}); replace or remove the file") from error


def image_size(path: Path) -> tuple[int, int]:
    """Return (height, width) in pixels from the header alone, after the EXIF rotation that reading applies.

    Raises:
        InputError: not an image, under 16 pixels on a side, or above 64 million pixels.
    """
    with _open(path) as image:
        width, height = image.size
        if width * height > MAX_PIXELS:
            raise InputError(
                f"{path}: {width}×{height} pixels is above the limit of {MAX_PIXELS:,}; scale it down first"
            )
        if min(width, height) < MIN_SIDE:
            raise InputError(f"{path}: {width}×{height} pixels is too small, at least {MIN_SIDE} on a side are needed")
        if image.getexif().get(_EXIF_ORIENTATION) in _EXIF_TRANSPOSED:
            width, height = height, width
        return height, width


def read_image(path: Path) -> Image:
    """Return the image as uint8 RGB [H, W, 3], turned upright by its EXIF orientation.

    Raises:
        InputError: as ``image_size``; also a truncated file or more than 8 bit a channel.
    """
    image_size(path)
    with _open(path) as image:
        if image.mode.startswith(("I", "F")):
            raise InputError(f"{path}: more than 8 bit a channel (mode {image.mode}); convert it to 8 bit first")
        try:
            upright = ImageOps.exif_transpose(image)
            return np.array((upright if upright is not None else image).convert("RGB"))
        except (OSError, SyntaxError, ValueError) as error:
            raise InputError(f"{path}: damaged image ({error}); copy it again from its source") from error


def read_labels(path: Path, height: int, width: int) -> np.ndarray:
    """Return a label image as uint8 [height, width].

    Raises:
        InputError: unreadable, not one 8-bit channel, or of another size than its image.
    """
    size = image_size(path)
    if size != (height, width):
        raise InputError(f"{path}: labels are {size[1]}×{size[0]} but the image is {width}×{height} pixels")
    with _open(path) as image:
        if image.mode not in ("L", "P"):
            raise InputError(f"{path}: a label image has one 8-bit channel, this one has mode {image.mode}")
        try:
            return np.array(image)
        except (OSError, SyntaxError, ValueError) as error:
            raise InputError(f"{path}: damaged label image ({error}); copy it again from its source") from error
