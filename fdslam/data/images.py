"""Bounded decoding of images: nothing is decoded before its size is known to be sane, and torn files are refused."""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pillow
from PIL import ImageOps, UnidentifiedImageError

from fdslam.errors import InputError
from fdslam.types import Image

SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".webp")
LIBRARIES = ("pillow", "opencv-python-headless", "numpy")  # whose versions decide what an image looks like
MAX_PIXELS = 64_000_000  # a decoded RGB image then takes at most 192 MB
MIN_SIDE = 16  # pixels: below this no keypoint, no cell grid means anything
KEPT_PIXELS = 8_000_000  # of the last image that was read, 24 MB
SETTLED = 2_000_000_000  # ns: after a change this long ago another one has another time
_EXIF_ORIENTATION, _EXIF_TRANSPOSED = 0x0112, (5, 6, 7, 8)


# What Pillow raises on torn and foreign files, beyond its own errors, which are OSErrors.
_DECODING = (OSError, SyntaxError, ValueError, EOFError, struct.error, Pillow.DecompressionBombError)


def is_file(path: Path) -> bool:
    """Tell whether there is such a file; a name that no file can have, as other people's lists may hold, is none."""
    try:
        return path.is_file()
    except (OSError, ValueError):  # too long for the file system, or with a NUL
        return False


_Version = tuple[str, int, int, int, int]  # path, inode, size, times of change in ns
_last: dict[str, tuple[_Version, Image]] = {}  # one image; what is replaced is the whole entry, so threads may share it


@contextmanager
def _opened(path: Path) -> Iterator[Pillow.Image]:
    """Open an image; whatever goes wrong while it is open is one line that names the file."""
    try:
        with Pillow.open(path) as image:
            yield image
    except FileNotFoundError:
        raise InputError(f"{path}: no such image; check the folder or the file that lists it") from None
    except UnidentifiedImageError as error:
        raise InputError(f"{path}: not an image; replace or remove the file") from error
    except _DECODING as error:
        raise InputError(f"{path}: damaged image ({error}); copy it again from its source") from error


def image_size(path: Path) -> tuple[int, int]:
    """Return (height, width) in pixels from the header alone, after the EXIF rotation that reading applies.

    Raises:
        InputError: not an image, under 16 pixels on a side, or above 64 million pixels.
    """
    with _opened(path) as image:
        return _bounded(path, image)


def _bounded(path: Path, image: Pillow.Image) -> tuple[int, int]:
    width, height = image.size
    if width * height > MAX_PIXELS:
        raise InputError(f"{path}: {width}×{height} pixels is above the limit of {MAX_PIXELS:,}; scale it down first")
    if min(width, height) < MIN_SIDE:
        raise InputError(f"{path}: {width}×{height} pixels is too small, at least {MIN_SIDE} on a side are needed")
    # Of a TIFF Pillow itself tells the upright size.
    turned = image.format != "TIFF" and image.getexif().get(_EXIF_ORIENTATION) in _EXIF_TRANSPOSED
    return (width, height) if turned else (height, width)


def read_image(path: Path) -> Image:
    """Return the image as uint8 RGB [H, W, 3], turned upright by its EXIF orientation.

    The last image is remembered: the stages of one query read the same file one after the other.

    Raises:
        InputError: as ``image_size``; also a truncated file or more than 8 bit a channel.
    """
    version = _version(path)
    known = _last.get("image")
    if version is not None and known is not None and known[0] == version:
        return known[1].copy()
    image = _decoded(path)
    if version is not None and image.shape[0] * image.shape[1] <= KEPT_PIXELS:
        _last["image"] = version, image.copy()
    return image


def _version(path: Path) -> _Version | None:
    """Return what tells a file from all that it was before; None where it has just been written, or is not there."""
    try:
        found = path.stat()
    except (OSError, ValueError):
        return None
    settled = time.time_ns() - max(found.st_mtime_ns, found.st_ctime_ns) > SETTLED
    return (str(path), found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns) if settled else None


def _decoded(path: Path) -> Image:
    with _opened(path) as image:
        _bounded(path, image)
        if image.mode.startswith(("I", "F")):
            raise InputError(f"{path}: more than 8 bit a channel (mode {image.mode}); convert it to 8 bit first")
        ImageOps.exif_transpose(image, in_place=True)  # otherwise, and by conversion to what it is, Pillow copies it
        return np.array(image if image.mode == "RGB" else image.convert("RGB"))


def enlarge(image: NDArray[np.uint8], min_side: int) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Upscale an image whose shorter side is below ``min_side``: small images have too few keypoints otherwise.

    Args:
        image: uint8 [H, W] or [H, W, 3].
        min_side: pixels; 0 leaves every image as it is.

    Returns:
        The image, and how many of its pixels make one of the original: float32 [2], x and y.
    """
    height, width = image.shape[:2]
    # The longer side of a very long image would explode.
    scale = min(min_side / min(height, width), np.sqrt(MAX_PIXELS / (height * width)))
    if scale <= 1:
        return image, np.ones(2, np.float32)
    size = round(width * scale), round(height * scale)
    larger = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_LINEAR), np.uint8)
    return larger, np.array([size[0] / width, size[1] / height], np.float32)


def read_labels(path: Path, height: int, width: int, classes: int) -> NDArray[np.uint8]:
    """Return a label image as uint8 [height, width], values below ``classes``.

    Raises:
        InputError: unreadable, not one 8-bit channel, of another size than its image, or with unknown labels.
    """
    with _opened(path) as image:
        size = _bounded(path, image)
        if size != (height, width):
            raise InputError(f"{path}: labels are {size[1]}×{size[0]} but the image is {width}×{height} pixels")
        if image.mode not in ("L", "P"):
            raise InputError(f"{path}: a label image has one 8-bit channel, this one has mode {image.mode}")
        labels = np.array(image)
    if labels.max() >= classes:
        raise InputError(f"{path}: holds the label {labels.max()}; labels are 0 to {classes - 1}, see fdslam/types.py")
    return labels
