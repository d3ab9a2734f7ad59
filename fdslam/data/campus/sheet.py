"""A contact sheet: many images at a glance, their change objects framed."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus.world import World

_INK = {"car": (255, 60, 60), "person": (255, 220, 0), "barrier": (255, 140, 0), "poster": (255, 0, 220),
        "table": (0, 220, 255), "board": (80, 255, 80)}  # fmt: skip


def contact_sheet(world: World, session: str, indices: Sequence[int], columns: int = 6) -> NDArray[np.uint8]:
    """Return images of a session side by side, row by row.

    Args:
        world: where they are taken.
        session: "map" or "query".
        indices: which images.
        columns: images in a row.

    Returns:
        [rows · H, columns · W, 3] RGB, black where there is no image.
    """
    height, width = world.height, world.width
    sheet = np.zeros((-(-len(indices) // columns) * height, columns * width, 3), np.uint8)
    for k, index in enumerate(indices):
        view = world.view(session, index)
        image = view.image.copy()
        for (x0, y0, x1, y1), kind in zip(view.boxes.astype(int).tolist(), view.kinds, strict=True):
            cv2.rectangle(image, (x0, y0), (x1 - 1, y1 - 1), _INK[kind], 1)
        y, x = k // columns * height, k % columns * width
        sheet[y : y + height, x : x + width] = image
    return sheet
