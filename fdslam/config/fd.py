"""The switches of fault diagnosis (§FD, Eq. 1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fdslam.config.options import Checked, option


@dataclass
class Support(Checked):
    """Which keypoints have a word of the map at about the place where it should be seen."""

    group: ClassVar[str | None] = "fd"

    support_images: int = option(
        3, "map images whose words are looked at, of the best hypotheses and their path neighbours", low=1, high=100
    )
    support_radius: float = option(
        4.0, "how far from its predicted place a word is looked for, percent of √(height · width)", low=0.1, high=100
    )


@dataclass
class Fd(Support):
    """Fault diagnosis (§FD, Eq. 1)."""

    pooling: str = option("min", "over the top-Y hypotheses", choices=("min", "mean", "max", "median"))
    order: str = option(
        "fuse_then_pool",
        "fuse the OBBs first, or pool the hypotheses first",
        choices=("fuse_then_pool", "pool_then_fuse"),
    )
    mean: str = option(
        "harmonic",
        "of the ranks of the OBBs that contain a pixel",
        choices=("harmonic", "arithmetic", "geometric"),
    )
    weights: str = option("equal", "of the OBBs in that mean: equal, or one over their area", choices=("equal", "area"))
    gate: int = option(
        0, "cells farther than this from any keypoint get the lowest LoC, cells; 0: no gate", low=0, high=1000
    )
    support: float = option(
        0.0,
        "weight of the share of unsupported keypoints around a cell beside the logarithm of the rank; 0: ranks alone",
        low=0,
        high=1000,
    )
    support_distance: int = option(
        60, "a keypoint is supported by a word at most this far from its descriptor, bits", low=0, high=256
    )
    support_sigma: float = option(1.5, "of the Gaussian around a cell, cells", low=0.1, high=20)
