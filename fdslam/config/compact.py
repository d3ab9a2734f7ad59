"""The switches of the compact binary map and of what is found with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fdslam.config.options import Checked, option


@dataclass
class Dense(Checked):
    """The binary descriptors on a dense grid that a map keeps of its images."""

    group: ClassVar[str | None] = "compact"

    source: str = option(
        "network",
        "features of an ONNX detector at strides 8 and 16, or oriented gradients, which need no network",
        choices=("network", "gradients"),
    )
    weights: str = option("", "ONNX file of source=network; empty: the detector of obb.yolo")
    fine_bits: int = option(64, "most bits of a descriptor at stride 8", choices=(64, 128, 192, 256))
    coarse_bits: int = option(128, "most bits of a descriptor at stride 16", choices=(64, 128, 192, 256))
    kilobytes: float = option(25.0, "most KB of the descriptors of an image: larger ones are seen smaller", low=1)
    sample: int = option(200, "map images, evenly spread, that the descriptors are centred on", low=1)


@dataclass
class Alignment(Checked):
    """Which map images a query is aligned with."""

    group: ClassVar[str | None] = "compact"

    hypotheses: int = option(5, "the best of the strong list that are matched, with their path neighbours", low=1)
    neighbours: int = option(1, "path neighbours before and after each", low=0, high=100)
    images: int = option(3, "of those, the ones with most agreeing keypoints that are compared", low=1, high=100)
    reach: float = option(
        6.0, "how far from its predicted place a look is searched, percent of √(height · width)", low=0, high=100
    )
    word_reach: float = option(4.8, "likewise a word", low=0, high=100)
    word_distance: int = option(
        64, "a keypoint has a partner at most this far from its descriptor, bits", low=0, high=256
    )
    fine_support: float = option(
        1.2, "of stride 8: σ of the cells around that support a match, cells", low=0.3, high=10
    )
    coarse_support: float = option(0.7, "likewise of stride 16", low=0.3, high=10)


@dataclass
class Compact(Dense, Alignment):
    """The compact binary map and the detectors CC, WC and MW."""

    fine: float = option(0.75, "weight of stride 8 in CC; the rest is that of stride 16", low=0, high=1)
    sigma: float = option(0.0, "of the Gaussian over the cells of CC, cells; 0: none", low=0, high=20)
    previous: int = option(
        0,
        "queries before the present one whose CC and EF are averaged with its own where they saw the same; 0: none",
        low=0,
        high=100,
    )
    threads: int = option(1, "threads of one inference. Never changes a result", low=1, high=1024)
