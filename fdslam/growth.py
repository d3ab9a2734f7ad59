"""What a map that grows has to look at again."""

from __future__ import annotations

from collections.abc import Sequence

from fdslam.data.images import is_file
from fdslam.detectors.registry import DETECTORS
from fdslam.errors import InputError
from fdslam.store import sha256_file
from fdslam.types import Frame


def check_growth(detectors: Sequence[str], frames: Sequence[Frame], learn: bool) -> None:
    """Find what stands in the way of more images in a map.

    Args:
        detectors: those that are used.
        frames: the images that the map has.
        learn: whether is learned again what may stay as it is.

    Raises:
        InputError: a detector cannot do without learning again, or an image that is learned from is gone or another.
    """
    always = [name for name in detectors if DETECTORS[name].learns == "again"]
    if always and not learn:
        raise InputError(
            f"update: {', '.join(always)} must learn from all map images again; fit them all anew, update with "
            "learn=True while they are still there, or detect with other detectors"
        )
    again = [name for name in detectors if DETECTORS[name].learns != "nothing"] if learn else []
    if not again:
        return
    gone = [frame.name for frame in frames if not is_file(frame.path)]
    other = [] if gone else [frame.name for frame in frames if sha256_file(frame.path) != frame.digest]
    way_out = "fit all images again" + ("" if always else ", keep what was learned with learn=False")
    for names, what in ((gone, "gone"), (other, "others than they were")):
        if names:
            raise InputError(
                f"update: {', '.join(again)} learn from all map images, and {len(names)} are {what}, the first "
                f"{names[0]}; {way_out}, or detect with FD or PC, which look at each once"
            )
