"""The OBB library: named sources of object bounding boxes, joined by ``+`` (§FD, fig. C).

A source is made once for a run from its settings, knows what decides its boxes, and gives the boxes of an image. Fixed
templates look at the image's size alone.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from fdslam.config import Obb
from fdslam.errors import InputError
from fdslam.obb.source import Source
from fdslam.obb.templates import TEMPLATES, Template
from fdslam.types import Boxes, Image

__all__ = ["SOURCES", "Library", "Source", "parse_library"]


def _template(name: str, config: Obb, device: str) -> Source:
    return Template(name)


def _yolo(config: Obb, device: str) -> Source:
    from fdslam.obb.yolo import Yolo  # onnxruntime takes a while to import, and most libraries do without

    return Yolo(config.yolo, device)


def _bing(config: Obb, device: str) -> Source:
    from fdslam.obb.bing.source import Bing  # its kernels take a while to load

    return Bing(config.bing)


SOURCES: dict[str, Callable[[Obb, str], Source]] = {  # name -> makes it from the settings and the device
    **{name: partial(_template, name) for name in TEMPLATES},
    "BING": _bing,
    "YOLO": _yolo,
}


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


class Library:
    """The sources of one run. Threads may share it."""

    def __init__(self, config: Obb, device: str = "cpu") -> None:
        """Make every source; models are read here, so that what is wrong with one is found at the start.

        Args:
            config: the names of the sources and their settings.
            device: where models run, cpu or cuda.

        Raises:
            InputError: an unknown source, or a model that is missing, damaged or not understood.
        """
        self.sources = {name: SOURCES[name](config, device) for name in parse_library(config.library)}

    @property
    def identity(self) -> list[dict[str, Any]]:
        """What decides the boxes of an image, JSON-able: the sources in use, with their settings, and no others."""
        return [{"source": name, **source.identity} for name, source in self.sources.items()]

    def boxes(self, image: Image) -> Boxes:
        """Return the OBBs of every source for one image (uint8 RGB [H, W, 3])."""
        return joined({name: source.boxes(image) for name, source in self.sources.items()})


def joined(found: dict[str, Any]) -> Boxes:
    """Return the boxes of several sources as one set.

    Args:
        found: per source float32 [n, 4] xyxy pixels.
    """
    source = tuple(name for name, boxes in found.items() for _ in range(len(boxes)))
    return Boxes(np.concatenate(list(found.values())).astype(np.float32).reshape(-1, 4), source)


def expected_boxes(config: Obb) -> int:
    """Return about how many OBBs the library has in an image, for estimates."""
    most = {"BING": config.bing.count, "YOLO": config.yolo.count}
    return sum(most[name] if name in most else len(TEMPLATES[name]) for name in parse_library(config.library))
