"""The OBB library: named sources of object bounding boxes, joined by ``+`` (§FD, fig. C).

A source is a function from an image to boxes. Fixed templates look at the image's size alone.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fdslam.errors import InputError
from fdslam.obb.templates import TEMPLATES, template_boxes
from fdslam.types import Boxes, Image

Source = Callable[[Image], NDArray[np.float32]]  # uint8 RGB [H, W, 3] -> float32 [n, 4] xyxy pixels, half-open


def _template(name: str, image: Image) -> NDArray[np.float32]:
    return template_boxes(name, *image.shape[:2])


SOURCES: dict[str, Source] = {name: partial(_template, name) for name in TEMPLATES}


def parse_library(library: str) -> tuple[str, ...]:
    """Split e.g. ``"J+B"`` into the names of its sources.

    Raises:
        InputError: an unknown or repeated source, or none at all.
    """
    names = tuple(part.strip() for part in library.split("+"))
    for name in names:
        if name not in SOURCES:
            raise InputError(f"obb.library={library}: unknown source {name!r}, choose from {', '.join(SOURCES)}")
    if len(set(names)) < len(names):
        raise InputError(f"obb.library={library}: a source is named twice")
    return names


def library_boxes(library: str, image: Image) -> Boxes:
    """Return the OBBs of every source of the library for one image (uint8 RGB [H, W, 3])."""
    names = parse_library(library)
    found = [SOURCES[name](image) for name in names]
    source = tuple(name for name, boxes in zip(names, found, strict=True) for _ in range(len(boxes)))
    return Boxes(np.concatenate(found).astype(np.float32), source)


def expected_boxes(library: str) -> int:
    """Return about how many OBBs the library has in an image, for estimates."""
    return sum(len(TEMPLATES[name]) for name in parse_library(library))
