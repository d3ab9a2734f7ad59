"""Overlapping tiles of a wide or tall image: on one canvas its objects would be too small to be found."""

from __future__ import annotations

import math
from fractions import Fraction

from fdslam.config import Yolo
from fdslam.obb.yolo.suppression import Tile


def tiles_of(height: int, width: int, canvas_height: int, canvas_width: int, config: Yolo) -> list[Tile]:
    """Return the tiles of an image, row by row; the first and the last lie at its border.

    A tile has the aspect of the canvas as far as the image reaches; an image smaller than a tile is its only tile.

    Args:
        height: of the image, pixels.
        width: of the image, pixels.
        canvas_height: of the model's input, pixels.
        canvas_width: of the model's input, pixels.
        config: ``tile``, ``tile_side`` and ``overlap``.

    Returns:
        xyxy pixels, half-open.
    """
    ratio = Fraction(height * canvas_width, width * canvas_height)
    long = max(ratio, 1 / ratio) >= 2  # it fills at most half of the canvas
    if config.tile == "never" or (config.tile == "auto" and not long):
        return [(0, 0, width, height)]
    if config.tile_side:
        scale = Fraction(config.tile_side, min(canvas_height, canvas_width))
    else:
        scale = min(Fraction(height, canvas_height), Fraction(width, canvas_width))
    tile_height = min(height, max(1, round(canvas_height * scale)))
    tile_width = min(width, max(1, round(canvas_width * scale)))
    return [
        (left, top, left + tile_width, top + tile_height)
        for top in _starts(height, tile_height, config.overlap)
        for left in _starts(width, tile_width, config.overlap)
    ]


def _starts(length: int, tile: int, overlap: float) -> list[int]:
    """Return where tiles begin that overlap by at least that share, as few and as evenly as can be."""
    if tile >= length:
        return [0]
    step = max(1, math.floor(tile * (1 - overlap)))
    count = -(-(length - tile) // step)
    return [round(Fraction(i * (length - tile), count)) for i in range(count + 1)]
