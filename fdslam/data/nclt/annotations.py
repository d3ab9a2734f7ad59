"""The changed objects of a (query, map) pair of sessions, and which images are its queries.

``annotations/QUERY-DATE_MAP-DATE.json`` is COCO. Its ``images`` are the queries of the pair: those with an annotation
show change, those without are distractors. A ``file_name`` ends in ``UTIME.tiff``, or in the name of the upright image
in the store, ``UTIME-KEY.png``; the folders before it may be left out, and a date or a camera among them must be the
right one. Boxes are in pixels of the upright image.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import NDArray

from fdslam.data.annotations import AnnotatedImage, check_size, clipped
from fdslam.data.annotations.coco import read_coco
from fdslam.data.nclt.layout import Session
from fdslam.errors import InputError
from fdslam.types import Frame

_DATE, _CAMERA = re.compile(r"\d{4}-\d{2}-\d{2}"), re.compile(r"Cam\d")
_STEM = re.compile(r"(\d{1,18})(?:-[0-9a-f]+)?")  # the second part: of an upright image in the store


@dataclass(frozen=True)
class Annotated:
    """The queries of a pair, and what is said of them."""

    path: Path
    images: dict[int, AnnotatedImage]  # position in the query session -> what is annotated there


def read_annotated(folder: Path, session: Session, map_date: str) -> Annotated | None:
    """Return what is annotated for a query session against a map session, None if there is no such file.

    Raises:
        InputError: no COCO file, no image in it, an image that the query session does not have, or one twice.
    """
    path = folder / f"{session.date}_{map_date}.json"
    if not path.is_file():
        return None
    listed = read_coco(path)
    if not listed:
        raise InputError(f"{path}: lists no image; list the queries under images, or remove the file")
    images: dict[int, AnnotatedImage] = {}
    for image in listed:
        position = _position(path, image.file, session)
        if position in images:
            raise InputError(
                f"{image.where}: {image.file!r} is annotated already by {images[position].where}; keep one"
            )
        images[position] = image
    return Annotated(path, images)


def _position(path: Path, file: str, session: Session) -> int:
    name = PurePosixPath(file)
    dates = {date for part in name.parts[:-1] for date in _DATE.findall(part)}
    cameras = {part for part in name.parts[:-1] if _CAMERA.fullmatch(part)}
    match = _STEM.fullmatch(name.stem)
    utime = int(match[1]) if match else -1
    position = int(np.searchsorted(session.utimes, utime))
    there = position < len(session.utimes) and session.utimes[position] == utime
    if not there or not dates <= {session.date} or not cameras <= {session.camera}:
        raise InputError(
            f"{path}: lists {file[:200]!r}, which is no image of {session.date} in {session.folder}; "
            "give the annotations of this query session, with names as they are there"
        )
    return position


def boxes_of(annotated: Annotated, frames: Mapping[int, Frame]) -> tuple[NDArray[np.float32], ...]:
    """Return the boxes of the queries, float32 [n, 4] xyxy each, in the order of ``frames``.

    Args:
        annotated: what the file says.
        frames: position in the query session -> upright query, for some of the annotated ones.

    Raises:
        InputError: a size that is not the upright image's, a box that is none or outside its image.
    """
    found = []
    for position, frame in frames.items():
        image = annotated.images[position]
        check_size(image, frame, "annotate the upright image, which this one is")
        boxes = [clipped(annotation, frame) for annotation in image.annotations]
        found.append(np.array(boxes, np.float32).reshape(-1, 4))
    return tuple(found)
