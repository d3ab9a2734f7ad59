"""BING as a source of the OBB library (§FD): the unsupervised one, its best 42 to 50 boxes an image."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fdslam.config import Bing as Settings
from fdslam.obb.bing import bing_boxes, digest, load_filters, own_filters
from fdslam.types import Image


class Bing:
    """BING with its filters. Threads may share it."""

    module: ClassVar[str] = "fdslam.obb.bing.source"

    def __init__(self, config: Settings) -> None:
        """Read the filters.

        Args:
            config: the switches.

        Raises:
            InputError: there are none, or they are damaged.
        """
        self.filters = load_filters(config.filters) if config.filters else own_filters()
        self.identity: dict[str, Any] = {"filters": digest(self.filters), "count": config.count}

    def boxes(self, image: Image) -> NDArray[np.float32]:
        """Return the best boxes of an image (uint8 RGB [H, W, 3]): float32 [n, 4] xyxy pixels, half-open."""
        return bing_boxes(image, self.filters, self.identity["count"])
