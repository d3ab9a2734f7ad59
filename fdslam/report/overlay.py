"""A live image with its heat and its candidate boxes, as a picture to look at."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import cv2
import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from fdslam.boxes import Candidate
from fdslam.types import CELL, Image

MAP = "inferno"  # perceptually uniform, and safe for the colour-blind
STRENGTH = 0.75  # of the heat where it is highest; where it is lowest the image shows through
BOX = (0, 229, 255)  # RGB


@cache
def _colours() -> NDArray[np.uint8]:
    return (mpl.colormaps[MAP](np.linspace(0, 1, 256))[:, :3] * 255).round().astype(np.uint8)


def overlay(image: Image, places: NDArray[np.float32], boxes: Sequence[Candidate]) -> bytes:
    """Return the picture as JPEG.

    Args:
        image: uint8 RGB [H, W, 3].
        places: float32 [rows, columns], each cell's place in its pool, 0 … 1.
        boxes: candidates; each is drawn with its rank.
    """
    height, width = image.shape[:2]
    # The top tenth is where anything is decided: the scale is spent on it.
    level = np.clip((places - 0.5) * 2, 0, 1) ** 3
    level = level.repeat(CELL, 0).repeat(CELL, 1)[:height, :width]
    colour = _colours()[(level * 255).astype(np.uint8)].astype(np.float32)
    grey = image.mean(axis=2, keepdims=True).repeat(3, axis=2)
    alpha = (STRENGTH * level)[:, :, None]
    drawn = np.ascontiguousarray((grey * (1 - alpha) + colour * alpha).astype(np.uint8))
    scale = max(1, round(max(height, width) / 600))
    for rank, one in enumerate(boxes, 1):
        x0, y0, x1, y1 = (int(value) for value in one.xyxy)
        cv2.rectangle(drawn, (x0, y0), (x1 - 1, y1 - 1), BOX, 2 * scale)
        at = (x0 + 3 * scale, min(y0 + 16 * scale, height - 3))
        cv2.putText(drawn, str(rank), at, cv2.FONT_HERSHEY_SIMPLEX, 0.5 * scale, BOX, scale, cv2.LINE_AA)
    return cv2.imencode(".jpg", cv2.cvtColor(drawn, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes()
