"""What every annotation reader gives, whatever it read, and the numbers in it, checked."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fdslam.errors import InputError

XYXY = tuple[float, float, float, float]  # x0, y0, x1, y1 in pixels, half-open: x0 < x1, y0 < y1
LARGEST = 1e9  # pixels: far beyond any image, and no sum of such numbers overflows


@dataclass(frozen=True)
class Annotation:
    """One box around something that has changed."""

    xyxy: XYXY  # finite; may reach over the border of its image
    label: str
    where: str  # how a message about it begins: its file, and its line, id or place there


@dataclass(frozen=True)
class AnnotatedImage:
    """One image, as the annotations name it."""

    file: str  # folders joined by /
    folder: Path  # of the annotation file: what ``file`` may be relative to
    size: tuple[int, int] | None  # width and height, pixels; None: not said
    annotations: tuple[Annotation, ...]
    where: str  # how a message about it begins


def finite(*values: Any) -> list[float]:
    """Return the numbers as floats.

    Raises:
        ValueError: one of them is no number, not finite, or far beyond any image.
    """
    for value in values:
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= LARGEST:
            raise ValueError(f"{value!r} is no number of pixels")
    return [float(value) for value in values]


def read_size(where: str, width: Any, height: Any) -> tuple[int, int] | None:
    """Return an image's width and height, or None where one of them is not said.

    Raises:
        InputError: one of them is no whole number above 0.
    """
    if width is None or height is None:
        return None
    for name, value in (("width", width), ("height", height)):
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not (number and 0 < value <= LARGEST and value == int(value)):
            raise InputError(f"{where}: the {name} is {value!r}; a whole number of pixels is needed")
    return int(width), int(height)


def load_json(path: Path, kind: str) -> dict[str, Any]:
    """Return the object that a JSON file holds; ``kind`` says in a message what it should be.

    Raises:
        InputError: it cannot be read or is no JSON object; a syntax error is named with its line.
    """
    try:
        value = json.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except json.JSONDecodeError as error:
        raise InputError(
            f"{path}, line {error.lineno}, column {error.colno}: no JSON ({error.msg}); export the {kind} again"
        ) from error
    except (ValueError, RecursionError) as error:  # not UTF-8, a number of thousands of digits, nested without end
        raise InputError(f"{path}: no JSON in UTF-8 ({error}); export the {kind} again") from error
    if not isinstance(value, dict):
        raise InputError(f"{path}: holds a {type(value).__name__}, no {kind}; export it again")
    return value
