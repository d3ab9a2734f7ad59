"""The switches of learned early fusion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fdslam.config.options import Checked, option


@dataclass
class Training(Checked):
    """How early fusion is trained on a map's own images."""

    group: ClassVar[str | None] = "early"

    images: int = option(400, "map images, evenly spread, that changes are made up in", low=1)
    rounds: int = option(1, "times that each of them is changed", low=1, high=100)
    trees: int = option(100, "trees of the gradient boosting", low=1, high=10_000)
    leaves: int = option(24, "most leaves of a tree", low=2, high=1000)
    leaf: int = option(200, "fewest cells that a leaf is learned from", low=1, high=1_000_000)
    l2: float = option(1.0, "L2 regularisation of what a leaf says", low=0, high=1e6)
    rate: float = option(0.08, "learning rate", low=1e-4, high=1)


@dataclass
class Early(Training):
    """Learned early fusion (EF)."""

    model: str = option(
        "auto",
        "trained on the map's images, or the shipped one, trained on the embedded world; auto: by the map's size",
        choices=("auto", "map", "shipped"),
    )
    least: int = option(40, "of model=auto: fewest map images that are trained on", low=1)
