"""LabelMe: a folder of JSON files, one per image, as the program labelme saves them (github.com/wkentaro/labelme).

Layout, as its ``LabelFile`` writes it: ``shapes`` (each with label, points as [[x, y], …] and shape_type),
``imagePath`` (relative to the JSON file), ``imageWidth`` and ``imageHeight``. The image itself may be embedded as
``imageData``; it is ignored. Shape types:

- ``rectangle``  two opposite corners
- ``polygon``    points; also what a missing shape_type means
- ``oriented_rectangle``  four corners
- ``circle``     the centre and a point on the rim
- ``mask``       the first and the last pixel of the box around it
- ``point``, ``points``, ``line`` and ``linestrip`` have no area
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path, PureWindowsPath
from typing import Any

from fdslam.data.annotations import shapes
from fdslam.data.annotations.annotation import XYXY, AnnotatedImage, Annotation, load_json, read_size
from fdslam.errors import InputError


def _two(points: list) -> list:
    if len(points) != 2:
        raise ValueError(f"it has {len(points)} points and not 2")
    return points


def _mask(points: list) -> XYXY:
    first, last = _two(points)
    return shapes.points([first, last, [value + 1 for value in last]])  # the last pixel belongs to it


def _circle(points: list) -> XYXY:
    return shapes.circle(*_two(points))


SHAPES: dict[str, Callable[[list], XYXY]] = {
    "rectangle": shapes.points,
    "polygon": shapes.points,
    "oriented_rectangle": shapes.points,
    "circle": _circle,
    "mask": _mask,
}


def read_labelme(folder: Path) -> tuple[AnnotatedImage, ...]:
    """Return the images of a folder of LabelMe files with the boxes around their shapes; subfolders are looked into.

    Raises:
        InputError: no JSON file there, one that is not LabelMe's, or a shape without a box.
    """
    files = sorted(folder.rglob("*.json"))
    if not files:
        raise InputError(f"{folder}: holds no LabelMe JSON; save the annotations there, or remove the folder")
    return tuple(_image(path) for path in files)


def _image(path: Path) -> AnnotatedImage:
    content = load_json(path, "LabelMe annotations")
    if "images" in content and "shapes" not in content:
        raise InputError(f"{path}: COCO and not LabelMe; give the file itself, as in dataset.annotations={path}")
    name, listed = content.get("imagePath"), content.get("shapes")
    if not isinstance(name, str) or not name or not isinstance(listed, list):
        raise InputError(f"{path}: not LabelMe annotations with imagePath and shapes; save them again in LabelMe")
    where = str(path)
    size = read_size(where, content.get("imageWidth"), content.get("imageHeight"))
    annotations = tuple(_annotation(f"{path}: shape {n}", shape) for n, shape in enumerate(listed, 1))
    return AnnotatedImage(PureWindowsPath(name).as_posix(), path.parent, size, annotations, where)


def _annotation(where: str, shape: Any) -> Annotation:
    if not isinstance(shape, dict) or not isinstance(shape.get("points"), list):
        raise InputError(f"{where} has no points; save it again in LabelMe")
    label, kind = shape.get("label"), shape.get("shape_type") or "polygon"
    if not isinstance(label, str):
        raise InputError(f"{where} has the label {label!r}; a text is needed")
    where = f"{where} {label!r}"
    if not isinstance(kind, str) or kind not in SHAPES:
        raise InputError(f"{where} is a {kind!r}, which has no area here; draw one of {', '.join(SHAPES)}")
    try:
        return Annotation(SHAPES[kind](shape["points"]), label, where)
    except ValueError as error:
        raise InputError(f"{where} cannot be read: {error}; correct it in LabelMe or remove it") from error
