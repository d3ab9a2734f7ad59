"""Images of the page: photographs as JPEG, cells as PNG of a pixel each, all as ``data:`` addresses."""

from __future__ import annotations

from base64 import b64encode
from functools import cache
from io import BytesIO
from pathlib import Path

import cv2
import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from fdslam.data.images import read_image
from fdslam.types import Frame

LARGE, SMALL = 480, 160  # pixels of the longer side
QUALITY = 78
LEVELS = 100  # of a heat map: one for each percent of the cells
COLOURS = "inferno"  # perceptually uniform, and safe for the colour-blind
DULL = (128, 128, 128)  # of a masked cell


def image_key(frame: Frame, side: int) -> str:
    """Return what an image is called inside the page: equal images are one."""
    return f"{frame.digest[:16]}-{side}"


def photograph(path: Path, side: int) -> str:
    """Return an image, its longer side at most ``side`` pixels, as JPEG.

    Raises:
        InputError: the image cannot be read.
    """
    image = read_image(path)
    height, width = image.shape[:2]
    size = _fitting(height, width, side)
    if size != (width, height):
        image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
    return _jpeg(Image.fromarray(image))


def blank(frame: Frame, side: int) -> str:
    """Return what stands in the place of a map image that is gone, or is another by now: a saved map keeps none."""
    size = _fitting(frame.height, frame.width, side)
    image = Image.new("L", size, 128)
    ImageDraw.Draw(image).text((size[0] / 2, size[1] / 2), "not kept", fill=255, anchor="mm", font_size=size[0] / 8)
    return _jpeg(image)


def _fitting(height: int, width: int, side: int) -> tuple[int, int]:
    """Return width and height, the longer at most ``side``."""
    scale = min(1, side / max(height, width))
    return max(1, round(width * scale)), max(1, round(height * scale))


def _jpeg(image: Image.Image) -> str:
    held = BytesIO()
    image.save(held, format="JPEG", quality=QUALITY, optimize=True)
    return _address("jpeg", held)


def heat_map(places: NDArray[np.floating]) -> str:
    """Return the places [rows, cols] of a query's cells among others, 0 to 1, as PNG."""
    levels = Image.fromarray(np.minimum(places * LEVELS, LEVELS - 1).astype(np.uint8))
    levels.putpalette(_palette())
    held = BytesIO()
    levels.save(held, format="PNG", optimize=True)
    return _address("png", held)


def mask_image(mask: NDArray[np.bool_]) -> str:
    """Return which cells [rows, cols] are masked as PNG, transparent elsewhere."""
    marked = Image.fromarray(mask.astype(np.uint8))
    marked.putpalette([0, 0, 0, *DULL])
    held = BytesIO()
    marked.save(held, format="PNG", optimize=True, transparency=0)
    return _address("png", held)


@cache
def _palette() -> list[int]:
    colours = mpl.colormaps[COLOURS](np.linspace(0, 1, LEVELS))[:, :3]
    return [int(value) for value in np.rint(255 * colours).ravel()]


def colour_bar() -> str:
    """Return CSS's gradient of the colours of a heat map, low to high."""
    stops = np.array(_palette()).reshape(-1, 3)[:: LEVELS // 10 - 1]
    return "linear-gradient(to right, " + ", ".join("#{:02x}{:02x}{:02x}".format(*stop) for stop in stops) + ")"


def _address(kind: str, held: BytesIO) -> str:
    return f"data:image/{kind};base64,{b64encode(held.getvalue()).decode()}"
