"""Images from a program: arrays in memory, files, and folders of them, as the frames that all stages work with."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image as Pillow

from fdslam.data.images import MAX_PIXELS, MIN_SIDE, SUFFIXES, image_size
from fdslam.errors import InputError
from fdslam.store import sha256_file
from fdslam.types import Frame, Image

IN_MEMORY = ".bmp"  # pixels as they are, written and read in about a millisecond


def images_in(folder: Path) -> list[Path]:
    """Return the images of a folder by name, without those in folders inside it.

    Raises:
        InputError: no such folder, or no image in it.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder")
    found = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    if not found:
        raise InputError(f"{folder}: holds no image ({', '.join(SUFFIXES)})")
    return found


def file_frame(path: Path, name: str = "") -> Frame:
    """Return the frame of an image file, measured and hashed but not decoded.

    Args:
        path: of the file.
        name: what it is called in results; without one its path.

    Raises:
        InputError: missing, not an image, too small or too large.
    """
    height, width = image_size(path)
    return Frame(name or str(path), path, sha256_file(path), height, width)


def as_image(value: Any, name: str) -> Image:
    """Return an image in memory as uint8 RGB [H, W, 3].

    Args:
        value: numpy uint8 [H, W, 3] RGB or [H, W] grey; a torch tensor [3, H, W] or [1, H, W], uint8 or float in
            0 … 1, on any device; or an image of Pillow.
        name: for messages.

    Raises:
        InputError: anything else, NaN, or a size that no stage can work with.
    """
    if isinstance(value, Pillow.Image):
        value = np.asarray(value.convert("RGB"))
    array = value if isinstance(value, np.ndarray) else _from_torch(value, name)
    if array.dtype != np.uint8:
        raise InputError(f"{name}: {array.dtype} values; give uint8, 0 to 255 (or a torch tensor of floats in 0 … 1)")
    if array.ndim == 2:
        array = np.repeat(array[:, :, None], 3, axis=2)
    if array.ndim != 3 or array.shape[2] != 3:
        raise InputError(f"{name}: an array of shape {array.shape}; an image is [height, width, 3], RGB")
    height, width = array.shape[:2]
    if min(height, width) < MIN_SIDE or height * width > MAX_PIXELS:
        raise InputError(
            f"{name}: {width}×{height} pixels; at least {MIN_SIDE} on a side and at most {MAX_PIXELS:,} are needed"
        )
    return np.ascontiguousarray(array)


def _from_torch(value: Any, name: str) -> np.ndarray:
    import torch  # takes a while, so only where an image is no array

    if not isinstance(value, torch.Tensor):
        raise InputError(f"{name}: a {type(value).__name__} is no image; give a path, a numpy array or a torch tensor")
    if value.ndim != 3 or value.shape[0] not in (1, 3):
        raise InputError(f"{name}: a tensor of shape {tuple(value.shape)}; an image is [3, height, width], RGB")
    tensor = value.detach().cpu()
    if tensor.is_floating_point():
        if not bool(((tensor >= 0) & (tensor <= 1)).all()):  # false for NaN as well
            raise InputError(f"{name}: floats outside 0 … 1 or NaN; scale the image to 0 … 1, or give uint8")
        tensor = (tensor * 255).round().to(torch.uint8)
    return tensor.expand(3, -1, -1).permute(1, 2, 0).numpy()


def frame_in(folder: Path, image: Image, name: str) -> Frame:
    """Return the frame of an image in memory, its pixels written to a folder: stages read images from files.

    Raises:
        InputError: the disk refuses.
    """
    encoded = cv2.imencode(IN_MEMORY, cv2.cvtColor(image, cv2.COLOR_RGB2BGR))[1].tobytes()
    digest = hashlib.sha256(encoded).hexdigest()
    path = folder / f"{digest}{IN_MEMORY}"
    try:
        path.write_bytes(encoded)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); free some space in {folder}") from error
    return Frame(name, path, digest, *image.shape[:2])


def frames_of(images: Any, folder: Path, first: int = 0) -> tuple[Frame, ...]:
    """Return the frames of images that a program has.

    Args:
        images: the path of a folder; or a sequence of paths, and of images in memory as ``as_image`` takes them.
        folder: where images in memory are written to.
        first: number of the first image in memory; they are called 000000, 000001, … by their place.

    Raises:
        InputError: there is no image, or one that cannot be used.
    """
    if isinstance(images, str | os.PathLike):
        root = Path(images).expanduser()
        found = tuple(file_frame(path, path.name) for path in images_in(root))
    else:
        if getattr(images, "ndim", 4) < 4:  # its rows would be taken for images
            raise InputError("one array is no collection of images; give a list of it, [image]")
        if not isinstance(images, Sequence | np.ndarray) and not hasattr(images, "__iter__"):
            raise InputError(f"a {type(images).__name__} is no collection of images; give a folder or a list")
        found = tuple(frame_of(image, folder, f"{first + i:06d}") for i, image in enumerate(images))
    if not found:
        raise InputError("no image given; give a folder, or a list of paths or arrays")
    return found


def frame_of(image: Any, folder: Path, name: str) -> Frame:
    """Return the frame of one image: a path, or pixels as ``as_image`` takes them, which are called ``name``."""
    if isinstance(image, str | os.PathLike):
        path = Path(image).expanduser()
        if path.is_dir():
            raise InputError(f"{path}: a folder where an image is wanted; give it by itself to fit or detect_all")
        return file_frame(path)
    return frame_in(folder, as_image(image, f"image {name}"), name)


def poses_of(poses: ArrayLike | None, count: int) -> NDArray[np.float64] | None:
    """Return the poses of so many images, float64 [count, 3] x, y in metres and heading in radians; None for none.

    Raises:
        InputError: no finite numbers of that shape.
    """
    if poses is None:
        return None
    try:
        found = np.asarray(poses, np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"poses: no array of numbers ({error}); give [{count}, 3]: x, y, heading") from error
    if found.shape != (count, 3) or not np.isfinite(found).all():
        raise InputError(
            f"poses: an array of shape {found.shape}; finite numbers [{count}, 3] are needed: x, y, heading"
        )
    return found
