"""How large an image is looked at, and in which tiles, so that its descriptors fit into the bytes that a map has.

A network with an input of fixed size sees the image whole, scaled into the top left corner, or where that would leave
most of the input empty in overlapping tiles that begin at multiples of the coarsest stride: their features then lie on
one grid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from fdslam.config import Dense
from fdslam.obb.yolo.letterbox import GREY
from fdslam.types import Image

STRIDES = (8, 16)  # of the fine and the coarse descriptors
COARSEST = 32  # of the networks: tiles begin at its multiples
OVERLAP = 64  # least overlap of neighbouring tiles, scaled pixels
LONG = 1.5  # from this ratio of the image's aspect to the input's on, tiles
LARGER = 1.25  # most that an image is enlarged
SMALLER = 0.99  # step by which it shrinks until the cells that its border cuts have room too


@dataclass(frozen=True)
class Canvas:
    """A scaled image and the tiles in which it is seen."""

    height: int  # scaled pixels of the image
    width: int
    tile_height: int  # scaled pixels of an input
    tile_width: int
    tops: tuple[int, ...]
    lefts: tuple[int, ...]

    def draw(self, image: Image) -> Image:
        """Return the scaled image on grey, uint8 [H, W, 3], large enough for all tiles."""
        scaled = cv2.resize(
            image,
            (self.width, self.height),
            interpolation=cv2.INTER_AREA if self.height < image.shape[0] else cv2.INTER_LINEAR,
        )
        size = self.tops[-1] + self.tile_height, self.lefts[-1] + self.tile_width
        canvas = np.full((*size, 3), GREY, np.uint8)
        canvas[: self.height, : self.width] = scaled
        return canvas

    def grid_shape(self, stride: int) -> tuple[int, int]:
        """Return rows and columns of the cells that hold some of the image."""
        return -(-self.height // stride), -(-self.width // stride)


def most_pixels(config: Dense) -> float:
    """Return about how many scaled pixels an image may have for its descriptors to fit into ``kilobytes``."""
    a_pixel = sum(each / stride**2 for each, stride in zip(_each(config), STRIDES, strict=True))
    return 1000 * config.kilobytes / a_pixel


def _each(config: Dense) -> tuple[float, float]:
    """Return the bytes of a descriptor, fine and coarse."""
    return config.fine_bits / 8, config.coarse_bits / 8


def _bytes(height: int, width: int, config: Dense) -> float:
    """Return the bytes of the descriptors of an image of so many scaled pixels."""
    return sum(
        each * -(-height // stride) * -(-width // stride) for each, stride in zip(_each(config), STRIDES, strict=True)
    )


def canvas_of(height: int, width: int, tile_height: int, tile_width: int, config: Dense) -> Canvas:
    """Return how an image is looked at.

    Args:
        height: of the image, pixels.
        width: of the image, pixels.
        tile_height: of the network's input, scaled pixels; 0: it takes any size.
        tile_width: likewise.
        config: the bytes that there are.
    """
    bound = min(math.sqrt(most_pixels(config) / (height * width)), LARGER)
    while _bytes(_side(height, bound), _side(width, bound), config) > 1000 * config.kilobytes:
        bound *= SMALLER
    if not tile_height or not tile_width:
        h, w = _side(height, bound), _side(width, bound)
        return Canvas(h, w, -(-h // COARSEST) * COARSEST, -(-w // COARSEST) * COARSEST, (0,), (0,))
    ratio = height * tile_width / (width * tile_height)
    whole = min(tile_height / height, tile_width / width)
    scale = min(bound, whole if max(ratio, 1 / ratio) < LONG else max(tile_height / height, tile_width / width))
    h, w = _side(height, scale), _side(width, scale)
    return Canvas(h, w, tile_height, tile_width, _starts(h, tile_height), _starts(w, tile_width))


def _side(side: int, scale: float) -> int:
    return max(1, round(side * scale))


def _starts(length: int, tile: int) -> tuple[int, ...]:
    """Return where tiles begin, multiples of COARSEST; the last reaches the end."""
    if length <= tile:
        return (0,)
    last = -(-(length - tile) // COARSEST) * COARSEST
    count = max(1, math.ceil(last / max(COARSEST, tile - OVERLAP)))
    return tuple(sorted({round(i * last / count / COARSEST) * COARSEST for i in range(count + 1)}))
