"""A contact sheet of the same places over the seasons, changes framed: python -m fdslam.data.campus.sheet FILE"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus.seasons import SESSIONS
from fdslam.data.campus.world import World

_INK = {"car": (255, 60, 60), "person": (255, 220, 0), "construction": (255, 140, 0), "poster": (255, 0, 220),
        "table": (0, 220, 255), "board": (80, 255, 80), "machine": (150, 120, 255)}  # fmt: skip


def contact_sheet(
    world: World, which: Sequence[tuple[str, int]], columns: int = 6, against: str | None = "SU"
) -> NDArray[np.uint8]:
    """Return images side by side, row by row.

    Args:
        world: where they are taken.
        which: session and index of each.
        columns: images in a row.
        against: a session; what does not stand in it is framed where it is clearly seen. None: no frames.

    Returns:
        [rows · H, columns · W, 3] RGB, black where there is no image.
    """
    height, width = world.height, world.width
    sheet = np.zeros((-(-len(which) // columns) * height, columns * width, 3), np.uint8)
    for k, (session, index) in enumerate(which):
        view = world.view(session, index)
        image = view.image.copy()
        framed = view.clear & world.changes(view, against) if against else np.zeros(len(view.items), bool)
        for (x0, y0, x1, y1), item in zip(view.boxes[framed].astype(int).tolist(), view.items[framed], strict=True):
            cv2.rectangle(image, (x0, y0), (x1 - 1, y1 - 1), _INK[world.items[item].kind], 1)
        y, x = k // columns * height, k % columns * width
        sheet[y : y + height, x : x + width] = image
    return sheet


def main() -> None:
    """Write the sheet of four sessions: a row for each, a column for each place."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("file", type=Path, help="a jpg or png to write")
    parser.add_argument("--seed", type=int, default=4, help="which campus")
    parser.add_argument("--images", type=int, default=384, help="of the four sessions together")
    parser.add_argument("--places", type=int, nargs="+", default=[2, 8, 14, 19, 31, 45], help="indices of images")
    parser.add_argument("--against", default="SU", choices=SESSIONS, help="frame what does not stand in this session")
    given = parser.parse_args()
    world = World(given.seed, given.images, 308, 404)
    which = [(session, index) for session in SESSIONS for index in given.places]
    sheet = contact_sheet(world, which, len(given.places), given.against)
    quality = [cv2.IMWRITE_JPEG_QUALITY, 80] if given.file.suffix in (".jpg", ".jpeg") else []
    cv2.imwrite(str(given.file), cv2.cvtColor(sheet, cv2.COLOR_RGB2BGR), quality)


if __name__ == "__main__":
    main()
