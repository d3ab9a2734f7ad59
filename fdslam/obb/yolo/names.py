"""Names of a detector's classes: those the model brings, or COCO's where it has 80 and says nothing."""

from __future__ import annotations

import ast
import difflib
from collections.abc import Mapping, Sequence

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


def named_by(metadata: Mapping[str, str]) -> tuple[str, ...]:
    """Return the names in a model's metadata: a list, or a dict from number to name, as YOLOv5 and later write it.

    Empty where it names none, or in a way that is not understood.
    """
    try:
        names = ast.literal_eval(metadata.get("names", "()"))
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return ()
    if isinstance(names, dict):
        if sorted(map(str, names)) != sorted(map(str, range(len(names)))):
            return ()
        names = [name for _, name in sorted((int(number), name) for number, name in names.items())]
    return tuple(map(str, names)) if isinstance(names, list | tuple) else ()


def class_names(metadata: Mapping[str, str], count: int) -> tuple[str, ...]:
    """Return the names of ``count`` classes; empty where nobody says them."""
    return named_by(metadata) or (COCO if count == len(COCO) else ())


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
            near = difflib.get_close_matches(one, names, n=3) or names[:8]
            raise InputError(
                f"obb.yolo.classes={one}: the model has no such class; near: {', '.join(near)}, "
                f"or a number from 0 to {count - 1}"
            )
    return tuple(sorted(set(found)))
