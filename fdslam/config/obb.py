"""The switches of the OBB library (§FD): which sources it has, and how each finds its boxes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from fdslam.config.options import Checked, option


@dataclass
class Yolo(Checked):
    """A YOLO-style detector, read by onnxruntime (docs/models.md)."""

    group: ClassVar[str | None] = "obb.yolo"

    weights: str = option("", "ONNX file of the detector; empty: the shipped one, which knows the embedded world alone")
    count: int = option(11, "most OBBs of an image, the best by score; none where nothing is found", low=1, high=1000)
    score: float = option(0.25, "boxes below this score are no OBBs", low=0, high=1)
    nms: float = option(0.45, "of boxes of one class that overlap by more (IoU), the best is kept", low=0, high=1)
    classes: list[str] = option([], "only these classes, by name or number; none: all", empty=True)
    layout: str = option(
        "auto",
        "YOLOX's raw heads, YOLOv5/v7's decoded rows or YOLOv8/11's columns; auto: as the model's shapes say",
        choices=("auto", "yolox", "yolov5", "yolov8"),
    )
    channels: str = option(
        "auto", "order of the input's channels; auto: bgr for YOLOX, rgb for others", choices=("auto", "rgb", "bgr")
    )
    white: float = option(0.0, "input value of white; 0: 255 for YOLOX, 1 for others", low=0, high=65_535)
    placement: str = option(
        "auto",
        "where the scaled image lies on the grey canvas; auto: corner for YOLOX, centre for others",
        choices=("auto", "corner", "centre"),
    )
    side: int = option(640, "input height and width of a model that takes any", low=32, high=8192)
    tile: str = option(
        "auto",
        "look at overlapping tiles; auto: where the whole image would fill at most half of the input",
        choices=("auto", "never", "always"),
    )
    tile_side: int = option(0, "side of a tile, pixels; 0: the image's shorter side", low=0, high=65_536)
    overlap: float = option(0.15, "least overlap of neighbouring tiles, share of a tile", low=0, high=0.9)
    threads: int = option(1, "threads of one inference. Never changes a result", low=1, high=1024)


@dataclass
class Bing(Checked):
    """BING, binarised normed gradients."""

    group: ClassVar[str | None] = "obb.bing"

    filters: str = option(
        "", "a file of ours, or the folder or common beginning of published ones; empty: those shipped"
    )
    count: int = option(50, "OBBs of an image, the best by score", low=1, high=5000)


@dataclass
class Obb(Checked):
    """The OBB library: sources joined by +, and their switches."""

    library: str = option("J+B+BING+YOLO", "parts of the OBB library joined by +, e.g. J+B or A+J+B+YOLO")
    yolo: Yolo = field(default_factory=Yolo)
    bing: Bing = field(default_factory=Bing)
