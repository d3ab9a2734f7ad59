"""From annotations to the boxes of queries: which image is meant, does it fit, what lies inside."""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fdslam.data.annotations.annotation import AnnotatedImage, Annotation
from fdslam.data.images import is_file
from fdslam.errors import InputError
from fdslam.types import Frame

log = logging.getLogger(__name__)
_SMALLEST_BOX = 1.0  # pixels inside the image


def match_boxes(
    images: Sequence[AnnotatedImage],
    frames: Sequence[Frame],
    roots: Sequence[Path],
    classes: Sequence[str] = (),
    complete: bool = False,
) -> tuple[NDArray[np.float32], ...]:
    """Return for every frame the boxes annotated on it; a frame without an annotation shows no change.

    Args:
        images: what a reader gave.
        frames: the queries.
        roots: folders that the names of the images may be relative to, the first that has such a file wins; the folder
            of the annotations is tried last.
        classes: labels that count as a change; none: all.
        complete: the annotations list the images without a box too, so that a frame that they lack is worth a warning.

    Returns:
        float32 [n, 4] xyxy per frame, clipped to it.

    Raises:
        InputError: an image that is annotated twice, or of another size than the annotations say; a box on an image
            that is not there, or outside its image; a class that no annotation has.
    """
    _check_classes(images, classes)
    positions = {_normal(frame.path): position for position, frame in enumerate(frames)}
    taken: dict[int, AnnotatedImage] = {}
    boxes: list[list[list[float]]] = [[] for _ in frames]
    for image in images:
        path = locate(image, roots)
        counted = [one for one in image.annotations if not classes or one.label in classes]
        if path is None and counted:
            raise InputError(
                f"{counted[0].where} is of {image.file!r}, which is no image here; "
                f"names must be as in {frames[0].name!r}, or remove what is annotated there"
            )
        position = None if path is None else positions.get(_normal(path))
        if position is None:  # a map image, or one that pairs.csv leaves out
            continue
        if position in taken:
            raise InputError(f"{image.where}: {image.file!r} is annotated already by {taken[position].where}; keep one")
        taken[position] = image
        check_size(image, frames[position])
        boxes[position] = [clipped(one, frames[position]) for one in counted]
    if complete and len(taken) < len(frames):
        lacking = next(frame.name for position, frame in enumerate(frames) if position not in taken)
        log.warning(
            "%d of %d queries are not in the annotations and count as unchanged: %s …",
            len(frames) - len(taken), len(frames), lacking,
        )  # fmt: skip
    return tuple(np.array(found, np.float32).reshape(-1, 4) for found in boxes)


def locate(image: AnnotatedImage, roots: Sequence[Path]) -> Path | None:
    """Return where the annotated image lies, or None if it is in none of the folders."""
    return next((path for root in (*roots, image.folder) if is_file(path := root / image.file)), None)


def _normal(path: Path) -> str:
    return os.path.normpath(path.absolute())


def _check_classes(images: Sequence[AnnotatedImage], classes: Sequence[str]) -> None:
    labels = {one.label for image in images for one in image.annotations}
    for name in classes:
        if name not in labels:
            there = ", ".join(sorted(labels)) or "no label at all"
            raise InputError(f"dataset.classes: nothing is annotated as {name!r}; the annotations have {there}")


def check_size(image: AnnotatedImage, frame: Frame, way_out: str = "use the image that was annotated") -> None:
    """Raise InputError if the annotations say another size than the image has."""
    if image.size is not None and image.size != (frame.width, frame.height):
        width, height = image.size
        raise InputError(
            f"{frame.path}: is {frame.width}×{frame.height} pixels, {image.where} says {width}×{height}; "
            f"the boxes would not fit: {way_out}"
        )


def clipped(annotation: Annotation, frame: Frame) -> list[float]:
    """Return the part of a box that lies inside its image, xyxy in pixels.

    Raises:
        InputError: less than a pixel of it does.
    """
    x0, y0, x1, y1 = annotation.xyxy
    box = [max(x0, 0), max(y0, 0), min(x1, frame.width), min(y1, frame.height)]
    if box[2] - box[0] < _SMALLEST_BOX or box[3] - box[1] < _SMALLEST_BOX:
        raise InputError(
            f"{annotation.where} from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) lies outside {frame.name} "
            f"({frame.width}×{frame.height} pixels); correct or remove it"
        )
    return box
