"""What a source of OBBs is: fixed templates, a detector of objects, an unsupervised proposer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fdslam.types import Image


class Source(Protocol):
    """A named source, made once for a run and used by many threads at a time."""

    @property
    def identity(self) -> Mapping[str, Any]:
        """Whatever decides the boxes, beside code and image: settings and digests of weights, JSON-able."""
        ...

    @property
    def module(self) -> str:
        """The module whose code decides the boxes; empty: the image's size alone decides, and nothing is stored."""
        ...

    def boxes(self, image: Image) -> NDArray[np.float32]:
        """Return the OBBs of an image (uint8 RGB [H, W, 3]): float32 [n, 4] xyxy pixels, half-open, inside it."""
        ...
