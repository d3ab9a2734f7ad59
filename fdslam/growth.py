"""What a map that grows has to look at again."""

from __future__ import annotations

from collections.abc import Sequence

from fdslam.data.images import is_file
from fdslam.detectors.registry import DETECTORS
from fdslam.errors import InputError
from fdslam.store import sha256_file
from fdslam.types import Frame


def check_photos(detectors: Sequence[str], frames: Sequence[Frame]) -> None:
    """Find what stands in the way of learning again from the images of a map.

    Args:
        detectors: those that are used.
        frames: the images that the map has.

    Raises:
        InputError: a detector learns from them, and one is gone or another.
    """
    again = [name for name in detectors if DETECTORS[name].learns]
    if not again:
        return
    gone = [frame.name for frame in frames if not is_file(frame.path)]
    other = [] if gone else [frame.name for frame in frames if sha256_file(frame.path) != frame.digest]
    for names, what in ((gone, "gone"), (other, "others than they were")):
        if names:
            raise InputError(
                f"update: {', '.join(again)} learn from all map images, and {len(names)} are {what}, the first "
                f"{names[0]}; fit all images again, keep what was learned with learn=False, or detect with FD or PC, "
                "which look at each once"
            )
