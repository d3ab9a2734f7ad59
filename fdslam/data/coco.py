"""Boxes of changed objects from a file of COCO annotations."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fdslam.errors import InputError
from fdslam.types import Frame

_SMALLEST_BOX = 1.0  # pixels inside the image


@dataclass(frozen=True)
class Coco:
    """What a file of annotations says, its boxes not yet checked."""

    path: Path
    files: dict[str, str]  # image id -> file_name
    sizes: dict[str, tuple[Any, Any]]  # image id -> width, height as the file has them, None where it has not
    annotations: tuple[tuple[str, Any, Any], ...]  # image id, bbox, id of the annotation


def read_coco(path: Path) -> Coco:
    """Read annotations.

    Raises:
        InputError: no COCO file, or an annotation of an image that it does not list.
    """
    try:
        coco = json.loads(path.read_text(encoding="utf-8-sig"))
        images = {str(image["id"]): image for image in coco["images"]}
        files = {key: str(image["file_name"]) for key, image in images.items()}
        sizes = {key: (image.get("width"), image.get("height")) for key, image in images.items()}
        annotations = tuple((str(a["image_id"]), a["bbox"], a.get("id")) for a in coco["annotations"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(f"{path}: not COCO annotations with images and annotations ({error!r})") from error
    for key, _, identity in annotations:
        if key not in files:
            raise InputError(f"{path}: annotation {identity} is of image {key}, which is not among its images")
    return Coco(path, files, sizes, annotations)


def check_size(coco: Coco, key: str, frame: Frame, remedy: str = "use the image that was annotated") -> None:
    """Raise InputError if the file says another size for image ``key`` than its frame has."""
    size = coco.sizes[key]
    if None in size or size == (frame.width, frame.height):
        return
    raise InputError(
        f"{frame.path}: is {frame.width}×{frame.height} pixels, {coco.path.name} says {size[0]!r}×{size[1]!r}; "
        f"the boxes would not fit: {remedy}"
    )


def clipped_box(coco: Coco, identity: Any, bbox: Any, frame: Frame) -> list[float]:
    """Return a COCO [x, y, w, h] as xyxy, clipped to the image.

    Raises:
        InputError: no four finite numbers, no area, or outside the image.
    """
    try:
        x, y, w, h = (float(value) for value in bbox)
        fine = all(map(math.isfinite, (x, y, w, h))) and w > 0 and h > 0
    except (TypeError, ValueError, OverflowError):
        fine = False
    if not fine:
        raise InputError(
            f"{coco.path}: annotation {identity} has the bbox {bbox}; [x, y, width, height] in pixels is needed"
        )
    box = [max(x, 0), max(y, 0), min(x + w, frame.width), min(y + h, frame.height)]
    if box[2] - box[0] < _SMALLEST_BOX or box[3] - box[1] < _SMALLEST_BOX:
        raise InputError(
            f"{coco.path}: annotation {identity} with the bbox {bbox} lies outside {frame.name} "
            f"({frame.width}×{frame.height} pixels); correct or remove it"
        )
    return box
