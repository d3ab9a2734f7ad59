"""OBBs by a YOLO-style detector (§FD): the supervised source of the library, at most 11 an image.

Where nothing is found the image has none of these OBBs: a box made up would say that there is something. What a model
needs is told by the configuration, or by its metadata (``names``; ``fdslam.layout``, ``fdslam.strides``,
``fdslam.channels``, ``fdslam.white``, ``fdslam.placement``), or recognised from its shapes (docs/models.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fdslam.config import Yolo as Settings
from fdslam.errors import InputError
from fdslam.obb.yolo.heads import LAYOUTS, Candidates, Head, UnknownHead, recognise
from fdslam.obb.yolo.letterbox import GREY, letterbox
from fdslam.obb.yolo.names import COCO, chosen_classes
from fdslam.obb.yolo.suppression import Tile, merged, suppressed, taken
from fdslam.obb.yolo.tiles import tiles_of
from fdslam.onnx_model import load_model, shipped
from fdslam.types import Image

SHIPPED = "yolo_campus.onnx"
_COARSEST = 32  # a side that is no multiple of the coarsest stride has cells that are cut
_LEAST = 1.0  # pixels: what is thinner holds no keypoint


@dataclass(frozen=True)
class Detections:
    """Objects of one image, best first."""

    xyxy: NDArray[np.float32]  # [n, 4] pixels of the image, half-open
    score: NDArray[np.float32]  # [n] 0 … 1
    label: NDArray[np.int64]  # [n] number of the class


class Yolo:
    """A detector as a source of OBBs. Threads may share it."""

    module: ClassVar[str] = "fdslam.obb.yolo"

    def __init__(self, config: Settings, device: str = "cpu", key: str = "obb.yolo.weights") -> None:
        """Read the model and tell how its output is read.

        Args:
            config: the switches.
            device: cpu or cuda.
            key: that names the file in the configuration, for messages.

        Raises:
            InputError: a model that is missing, damaged or not understood, or a class that it does not have.
        """
        self.config = config
        way_out = "check the path, or fetch one: python -m fdslam.fetch yolox-nano"
        if not config.weights:
            way_out = (
                "it is the shipped detector and not part of this installation; give obb.yolo.weights=FILE "
                "(python -m fdslam.fetch yolox-nano fetches one), or run without YOLO, as obb=j_b does"
            )
        self.model = load_model(config.weights or shipped(SHIPPED), key, way_out, config.threads, device)
        self.height = self._side(self.model.height)
        self.width = self._side(self.model.width)
        self.head = self._recognised()
        # Order of the channels, value of white, and where the image lies: as told, or as its family has it.
        self.input = self._input()
        self.names = self.model.names() or (COCO if self.head.classes == len(COCO) else ())
        self.classes = chosen_classes(config.classes, self.names, self.head.classes)

    def _side(self, fixed: int | None) -> int:
        side = fixed or self.config.side
        if side % _COARSEST and not fixed:
            raise InputError(f"obb.yolo.side={side}: a multiple of {_COARSEST} is needed, as 640")
        return side

    def _recognised(self) -> Head:
        says = self.model.metadata
        if says.get("task", "detect") != "detect":
            raise InputError(f"{self.model.where}: its metadata say task={says['task']}; one that detects is needed")
        layout = self._told("layout", LAYOUTS)
        # Before the layout is known, white is not either; what a grey canvas gives has the same shape by every scale.
        grey = np.full((self.height, self.width, 3), GREY * self._white(layout) / 255, np.float32)
        outputs = self.model.run(grey)
        strides = [int(stride) for stride in self.model.numbers("strides")]
        try:
            return recognise(outputs, self.height, self.width, layout, strides, len(self.model.names()))
        except UnknownHead as error:
            raise InputError(f"{self.model.where}: {error}") from error

    def _told(self, key: str, choices: tuple[str, ...]) -> str:
        """Return what the configuration says of a key or, where that is auto, the model; empty where neither does."""
        configured = str(getattr(self.config, key))
        return configured if configured != "auto" else self.model.says(key, choices)

    def _white(self, layout: str) -> float:
        family = 255.0 if layout == "yolox" else 1.0
        return self.config.white or next(iter(self.model.numbers("white")), family)

    def _input(self) -> tuple[str, float, str]:
        raw = self.head.layout == "yolox"
        return (
            self._told("channels", ("rgb", "bgr")) or ("bgr" if raw else "rgb"),
            self._white(self.head.layout),
            self._told("placement", ("corner", "centre")) or ("corner" if raw else "centre"),
        )

    @property
    def identity(self) -> dict[str, Any]:
        """Whatever decides the boxes of an image; threads do not."""
        c = self.config
        return {
            **self.model.identity,
            "input": [*self.input, self.height, self.width],
            "head": [self.head.layout, *self.head.strides],
            "classes": list(self.classes),
            "boxes": [c.count, c.score, c.nms],
            "tiles": [c.tile, c.tile_side, c.overlap],
        }

    def boxes(self, image: Image) -> NDArray[np.float32]:
        """Return the OBBs of an image, best first: float32 [n, 4] xyxy pixels, n from 0 to ``count``."""
        return self.detect(image).xyxy

    def detect(self, image: Image) -> Detections:
        """Return the objects of an image (uint8 RGB [H, W, 3]), at most ``count``."""
        height, width = image.shape[:2]
        tiles = tiles_of(height, width, self.height, self.width, self.config)
        parts = [self._tile(image, tile) for tile in tiles]
        found = merged(parts, tiles, height, width, self.config.nms)
        sides = found.xyxy[:, 2:] - found.xyxy[:, :2]
        best = taken(found, np.flatnonzero((sides >= _LEAST).all(axis=1))[: self.config.count])
        return Detections(best.xyxy.astype(np.float32), best.score, best.label)

    def _tile(self, image: Image, tile: Tile) -> Candidates:
        x0, y0, x1, y1 = tile
        channels, white, placement = self.input
        placed = letterbox(y1 - y0, x1 - x0, self.height, self.width, placement)
        canvas = placed.draw(image[y0:y1, x0:x1])
        ordered = canvas[..., ::-1] if channels == "bgr" else canvas
        fed = ordered.astype(np.float32) * np.float32(white / 255)
        output = self.model.run(fed)[self.head.output]
        if not np.isfinite(output).all():
            raise InputError(f"{self.model.where}: its output is not finite; the model is damaged")
        found = self.head.decode(output, self.config.score)
        found = taken(found, np.isin(found.label, self.classes))
        placed_back = placed.back(found.xyxy) + np.array([x0, y0, x0, y0], np.float64)
        return suppressed(Candidates(placed_back, found.score, found.label), self.config.nms)
