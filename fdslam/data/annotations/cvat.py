"""CVAT for images 1.1: one XML file, exported by CVAT for any task (docs.cvat.ai, "XML annotation format").

Layout, as documented there: ``annotations`` holds ``version``, ``meta`` and one ``image`` (id, name, width, height) per
image, and an image holds its shapes, each with a label:

- ``box``      xtl, ytl, xbr, ybr; optionally rotation in degrees about its centre
- ``polygon``  points as x,y;x,y;…
- ``ellipse``  cx, cy, rx, ry; optionally rotation
- ``cuboid``   eight corners, xtl1, ytl1 and so on
- ``mask``     left, top, width, height, and a run-length code, which is not needed for the box
- ``polyline``, ``points`` and ``skeleton`` have no area; a ``tag`` is of the image as a whole

Every shape becomes the box around it. The flavour "CVAT for video 1.1" holds ``track`` elements with frame numbers and
no file names: CVAT exports the same task as "CVAT for images 1.1" too, with the tracks split by frames.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from xml.parsers import expat

from fdslam.data.annotations import shapes
from fdslam.data.annotations.annotation import XYXY, AnnotatedImage, Annotation, read_size
from fdslam.errors import InputError

log = logging.getLogger(__name__)
Attributes = dict[str, str]
_CUBOID = [(f"x{corner}{face}", f"y{corner}{face}") for corner in ("tl", "bl", "tr", "br") for face in "12"]
_AGAIN = "export the task as 'CVAT for images 1.1'"


def _numbers(attributes: Attributes, *names: str) -> list[float]:
    return [float(attributes[name]) for name in names]


def _rotation(attributes: Attributes) -> float:
    return float(attributes.get("rotation", 0))


def _box(a: Attributes) -> XYXY:
    return shapes.rotated_box(shapes.corners(*_numbers(a, "xtl", "ytl", "xbr", "ybr")), _rotation(a))


def _polygon(a: Attributes) -> XYXY:
    return shapes.points([float(value) for value in point.split(",")] for point in a["points"].split(";"))


def _ellipse(a: Attributes) -> XYXY:
    return shapes.rotated_ellipse(_numbers(a, "cx", "cy"), _numbers(a, "rx", "ry"), _rotation(a))


def _cuboid(a: Attributes) -> XYXY:
    return shapes.points(_numbers(a, *names) for names in _CUBOID)


def _mask(a: Attributes) -> XYXY:
    left, top, width, height = _numbers(a, "left", "top", "width", "height")
    return shapes.corners(left, top, left + width, top + height)


SHAPES: dict[str, Callable[[Attributes], XYXY]] = {
    "box": _box,
    "polygon": _polygon,
    "ellipse": _ellipse,
    "cuboid": _cuboid,
    "mask": _mask,
}


def read_cvat(path: Path) -> tuple[AnnotatedImage, ...]:
    """Return the images of a file "CVAT for images 1.1" with the boxes around their shapes.

    Nothing outside the file is ever read and no entity is expanded: a document type, which could ask for either, is
    refused.

    Raises:
        InputError: no XML, another XML, the flavour for video, or a shape without a box: each with its line.
    """
    reader = _Reader(path)
    try:
        with path.open("rb") as file:
            reader.parser.ParseFile(file)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except expat.ExpatError as error:
        reason = expat.errors.messages.get(error.code, str(error))
        raise InputError(f"{path}, line {error.lineno}: no XML ({reason}); {_AGAIN} again") from error
    except (ValueError, LookupError) as error:  # an encoding that Python does not know, or lies
        raise InputError(f"{path}: no XML ({error}); {_AGAIN} again") from error
    if not reader.images:
        raise InputError(f"{path}: holds no image; {_AGAIN}")
    if reader.tags:
        log.warning("%s: %d tags are of whole images and left out; only shapes become boxes", path, reader.tags)
    return tuple(reader.images)


class _Reader:
    """Goes through the elements in the order of the file; ``images`` is what it has found."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.images: list[AnnotatedImage] = []
        self.tags = 0
        self._open: list[str] = []  # names of the elements around the current one
        self._shapes: list[Annotation] = []  # of the current image
        self._image: tuple[str, Attributes] = ("", {})  # of the current image: where it stands, and its attributes
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.StartDoctypeDeclHandler = self._doctype

    def _where(self) -> str:
        return f"{self.path}, line {self.parser.CurrentLineNumber}"

    def _doctype(self, *_: object) -> None:
        raise InputError(f"{self._where()}: has a document type (DOCTYPE), which CVAT never writes; {_AGAIN}")

    def _start(self, name: str, attributes: Attributes) -> None:
        around = self._open
        if not around and name != "annotations":
            raise InputError(f"{self._where()}: begins with <{name}>, CVAT's files with <annotations>; {_AGAIN}")
        if around == ["annotations"] and name == "track":
            raise InputError(
                f"{self._where()}: a track, as in 'CVAT for video 1.1', which names frames by number only; {_AGAIN}: "
                "it splits tracks by frames"
            )
        if around == ["annotations"] and name == "image":
            self._shapes, self._image = [], (self._where(), attributes)
            if not attributes.get("name"):
                raise InputError(f"{self._where()}: an image without name; {_AGAIN}")
        elif around == ["annotations", "image"]:
            self._shape(name, attributes)
        self._open.append(name)

    def _shape(self, name: str, attributes: Attributes) -> None:
        label = attributes.get("label", "")
        where = f"{self._where()}: the {name} {label!r}"
        if name == "tag":
            self.tags += 1
            return
        if name not in SHAPES:
            raise InputError(f"{where} has no area; draw a rectangle instead, or one of {', '.join(SHAPES)}")
        try:
            xyxy = SHAPES[name](attributes)
        except KeyError as error:
            raise InputError(f"{where} lacks {error}; {_AGAIN}") from error
        except ValueError as error:
            raise InputError(f"{where} cannot be read: {error}; correct it in CVAT or remove it") from error
        self._shapes.append(Annotation(xyxy, label, where))

    def _end(self, name: str) -> None:
        self._open.pop()
        if name == "image" and self._open == ["annotations"]:
            where, attributes = self._image
            size = [_whole(attributes.get(side)) for side in ("width", "height")]
            file = attributes["name"].replace("\\", "/")
            image = AnnotatedImage(file, self.path.parent, read_size(where, *size), tuple(self._shapes), where)
            self.images.append(image)


def _whole(text: str | None) -> int | str | None:
    return int(text) if text is not None and text.isdecimal() else text
