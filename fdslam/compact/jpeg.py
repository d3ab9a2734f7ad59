"""What keeping the images themselves would take: the compact map is no saving over them, and says so."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from fdslam.data.images import read_image
from fdslam.sampling import evenly
from fdslam.types import Frame

QUALITY = 75  # usual for photographs
SAMPLE = 20  # images that are looked at


def grey_jpeg(frames: Sequence[Frame]) -> float:
    """Return the mean bytes of images as grey JPEGs of their size, over a few that are evenly spread."""
    sizes = []
    for i in evenly(len(frames), SAMPLE):
        grey = cv2.cvtColor(read_image(frames[i].path), cv2.COLOR_RGB2GRAY)
        sizes.append(len(cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1]))
    return float(np.mean(sizes))
