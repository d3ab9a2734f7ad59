"""The switches of the mask of sky and ground (§Performance)."""

from __future__ import annotations

from dataclasses import dataclass

from fdslam.config.options import Checked, option


@dataclass
class Mask(Checked):
    """Sky and ground, where no change of interest is expected; all but the first two are of mask=deeplabv3plus."""

    source: str = option("none", "where the labels come from", choices=("none", "labels", "deeplabv3plus"))
    min_share: float = option(1.0, "a cell is set to 0 where at least this share of it is sky or ground", low=0, high=1)
    weights: str = option("", "ONNX file of the model; empty: the shipped one, which knows the embedded world alone")
    label_map: str = option(
        "auto",
        "what the model's classes are; auto: as it names them, or by their number",
        choices=("auto", "ade20k32", "cityscapes19", "campus", "custom"),
    )
    sky: list[int] = option([], "of label_map=custom: the classes that are sky", low=0, empty=True)
    ground: list[int] = option([], "of label_map=custom: the classes that are ground", low=0, empty=True)
    normalise: str = option(
        "auto",
        "values v of 0 … 255 enter as (v - 128) / 128, v / 255, ImageNet's, or v; auto: as the model says, or signed",
        choices=("auto", "signed", "unit", "imagenet", "raw"),
    )
    channels: str = option(
        "auto", "order of the input's channels; auto: as the model says, or rgb", choices=("auto", "rgb", "bgr")
    )
    side: int = option(512, "input height and width of a model that takes any", low=32, high=4096)
    threads: int = option(1, "threads of one inference. Never changes a result", low=1, high=1024)
