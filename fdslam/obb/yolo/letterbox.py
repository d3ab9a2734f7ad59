"""An image, scaled as a whole, on the grey canvas that a detector takes, and boxes from there back to the image.

Sizes are exact: they are computed in fractions, so that no rounding of a float decides about a pixel. YOLOX puts the
image into the top left corner and drops the fraction of a pixel; YOLOv5 and later put it into the centre and round.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.types import Image

GREY = 114


@dataclass(frozen=True)
class Letterbox:
    """Where an image of ``height`` × ``width`` pixels lies on its canvas; everything in whole pixels."""

    height: int
    width: int
    canvas_height: int
    canvas_width: int
    scaled_height: int
    scaled_width: int
    top: int
    left: int

    def draw(self, image: Image) -> Image:
        """Return the canvas: uint8 [canvas_height, canvas_width, 3], grey where the image is not."""
        size = self.scaled_width, self.scaled_height
        scaled = image if size == (self.width, self.height) else cv2.resize(image, size, interpolation=cv2.INTER_LINEAR)
        canvas = np.full((self.canvas_height, self.canvas_width, 3), GREY, np.uint8)
        canvas[self.top : self.top + size[1], self.left : self.left + size[0]] = scaled
        return canvas

    def back(self, xyxy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return boxes [n, 4] on the canvas as boxes on the image, float64 xyxy, cut off at its border."""
        offset = np.array([self.left, self.top, self.left, self.top], np.float64)
        size = np.array([self.width, self.height, self.width, self.height], np.float64)
        scaled = np.array([self.scaled_width, self.scaled_height, self.scaled_width, self.scaled_height], np.float64)
        return np.clip((xyxy - offset) * size / scaled, 0, size)


def letterbox(height: int, width: int, canvas_height: int, canvas_width: int, placement: str) -> Letterbox:
    """Return where an image lies on a canvas that it fills as far as its aspect lets it.

    Args:
        height: of the image, pixels.
        width: of the image, pixels.
        canvas_height: pixels.
        canvas_width: pixels.
        placement: "corner" (YOLOX) or "centre" (YOLOv5 and later).
    """
    ratio = min(Fraction(canvas_height, height), Fraction(canvas_width, width))
    rounded = int if placement == "corner" else round
    scaled_height, scaled_width = max(1, rounded(height * ratio)), max(1, rounded(width * ratio))
    rest = canvas_height - scaled_height, canvas_width - scaled_width
    top, left = (0, 0) if placement == "corner" else (rest[0] // 2, rest[1] // 2)
    return Letterbox(height, width, canvas_height, canvas_width, scaled_height, scaled_width, top, left)
