"""Names of a detector's classes, and which of them count."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

from fdslam.errors import InputError

COCO = (
    "person", "bicycle", "car", "motorcycle", "airplane", "bus", "train", "truck", "boat", "traffic light",
    "fire hydrant", "stop sign", "parking meter", "bench", "bird", "cat", "dog", "horse", "sheep", "cow", "elephant",
    "bear", "zebra", "giraffe", "backpack", "umbrella", "handbag", "tie", "suitcase", "frisbee", "skis", "snowboard",
    "sports ball", "kite", "baseball bat", "baseball glove", "skateboard", "surfboard", "tennis racket", "bottle",
    "wine glass", "cup", "fork", "knife", "spoon", "bowl", "banana", "apple", "sandwich", "orange", "broccoli",
    "carrot", "hot dog", "pizza", "donut", "cake", "chair", "couch", "potted plant", "bed", "dining table", "toilet",
    "tv", "laptop", "mouse", "remote", "keyboard", "cell phone", "microwave", "oven", "toaster", "sink",
    "refrigerator", "book", "clock", "vase", "scissors", "teddy bear", "hair drier", "toothbrush",
)  # fmt: skip


def chosen_classes(wanted: Sequence[str], names: Sequence[str], count: int) -> tuple[int, ...]:
    """Return the numbers of the classes that the configuration names; all of them where it names none.

    Args:
        wanted: names or numbers.
        names: of all classes; empty: not known.
        count: of classes.

    Raises:
        InputError: a class that the model does not have.
    """
    if not wanted:
        return tuple(range(count))
    found = []
    for one in wanted:
        if one in names:
            found.append(list(names).index(one))
        elif one.isdecimal() and int(one) < count:
            found.append(int(one))
        elif not names:
            raise InputError(
                f"obb.yolo.classes={one}: this model does not name its classes; give numbers from 0 to {count - 1}"
            )
        else:
            near = difflib.get_close_matches(one, names, n=3, cutoff=0.75) or names[:8]
            raise InputError(
                f"obb.yolo.classes={one}: the model has no such class; near: {', '.join(near)}, "
                f"or a number from 0 to {count - 1}"
            )
    return tuple(sorted(set(found)))
