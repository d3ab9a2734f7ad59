"""What a source of dense descriptors is: a network or none, behind one interface."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fdslam.compact.grid import Grid
from fdslam.types import Image

Level = NDArray[np.float32]  # [rows, cols, channels]


class Source(Protocol):
    """Describes an image at strides 8 and 16. Threads may share it."""

    @property
    def identity(self) -> dict[str, Any]:
        """Whatever decides the descriptors of an image, JSON-able."""
        ...

    def grids(self, height: int, width: int) -> tuple[Grid, Grid]:
        """Return where the descriptors of an image of that size lie, the fine and the coarse."""
        ...

    def describe(self, image: Image) -> tuple[Level, Level]:
        """Return the fine and the coarse descriptors of an image (uint8 RGB [H, W, 3])."""
        ...
