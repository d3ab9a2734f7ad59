"""The configuration's schema: every switch, its range, its unit and the paper's symbol.

``conf/`` holds the values; this file says which keys exist and what they may be. Hydra merges the two, so an unknown
key or a wrong type never reaches a stage. A base class (``Orb``, ``Vocabulary``, …) names the fields that one stage
reads: its artefacts are addressed by those alone. The bag of words, the OBB library, anomaly detection and the
data sets have files of their own.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from hydra.core.config_store import ConfigStore

from fdslam.config.ad import Ad, Autoencoder, Places
from fdslam.config.bow import Bow, Orb, Retrieval, Vocabulary
from fdslam.config.compact import Alignment, Compact, Dense
from fdslam.config.dataset import DATASETS, Campus, Dataset, Folder, Nclt, Pairs, Rendering
from fdslam.config.early import Early, Training
from fdslam.config.fd import Fd, Support
from fdslam.config.mask import Mask
from fdslam.config.obb import Bing, Obb, Yolo
from fdslam.config.options import Checked, option, part
from fdslam.config.pc import Comparison, Keypoints, Pc
from fdslam.config.tracker import Tracker
from fdslam.errors import InputError

__all__ = [
    "METHODS",
    "Ad",
    "Alignment",
    "Autoencoder",
    "Bing",
    "Bow",
    "Campus",
    "Compact",
    "Comparison",
    "Config",
    "Dataset",
    "Dense",
    "Early",
    "Evaluation",
    "Fd",
    "Folder",
    "Keypoints",
    "Mask",
    "Mix",
    "Nclt",
    "Obb",
    "Orb",
    "Pairs",
    "Pc",
    "Places",
    "Rendering",
    "Report",
    "Retrieval",
    "Support",
    "Tracker",
    "Training",
    "Vocabulary",
    "Yolo",
    "part",
    "register",
]

METHODS = ("FD", "PC", "AD", "FD+AD+PC", "FD+AD", "FD+PC")  # Table I, top to bottom
COMPACT = ("CC", "WC", "MW", "EF")  # detectors of the compact map, and their early fusion
SINGLE = ("FD", "PC", "AD", *COMPACT)


@dataclass
class Mix(Checked):
    """Which rows the table has and how detectors are fused (§Performance)."""

    rows: list[str] = option(["FD", "PC", "AD", "FD+AD+PC"], "rows of the table: detectors, or several joined by +")
    rule: str = option(
        "harmonic",
        "Eq. 1 on ascending ranks (b), the sum of 1 / rank (a), or of the normal scores or logarithms of p-values",
        choices=("harmonic", "reciprocal", "stouffer", "fisher"),
    )

    def __post_init__(self) -> None:
        """Raise InputError for a row that is no mix of detectors."""
        super().__post_init__()
        for row in self.rows:
            parts = row.split("+")
            if unknown := [name for name in parts if name not in SINGLE]:
                raise InputError(f"mix.rows={row}: {unknown[0]!r} is no detector; choose from {', '.join(SINGLE)}")
            if len(set(parts)) < len(parts):
                raise InputError(f"mix.rows={row}: a detector is named twice")

    @property
    def detectors(self) -> list[str]:
        """What the rows are made of, in the order of their first use."""
        return list(dict.fromkeys(part for row in self.rows for part in row.split("+")))

    @property
    def compact(self) -> list[str]:
        """Those of them that need the compact map."""
        return [name for name in self.detectors if name in COMPACT]


@dataclass
class Evaluation(Checked):
    """The accuracy table (§Performance)."""

    X: list[int] = option([5, 10, 15, 20], "percent of the cells that are selected", low=1, high=100)
    Y: int = option(10, "hypotheses of the strong list", low=1, high=1000)
    curve_Y: list[int] = option([], "other numbers of hypotheses, for a curve over Y", low=1, high=1000, empty=True)
    pool: str = option(
        "all", "cells ranked over all queries, or within each: which the terminal shows first", choices=("all", "query")
    )
    criterion: str = option(
        "coverage", "an object is found by |box ∩ selected| / |box| or by IoU", choices=("coverage", "iou")
    )
    found: float = option(0.5, "the least such share", low=0, high=1)
    viewpoint: str = option(
        "predicted", "hypotheses from the strong list or from the true place", choices=("predicted", "true")
    )
    bootstrap: int = option(1000, "resamplings of the queries for the intervals", low=10, high=100_000)
    confidence: float = option(0.95, "of the intervals", low=0.5, high=0.999)


@dataclass
class Report(Checked):
    """What is drawn."""

    pictures: int = option(12, "pictures of as many best and as many worst queries", low=0, high=10_000)
    page: bool = option(True, "write report.html, one page that opens from disk")
    megabytes: float = option(
        20.0,
        "size of that page: as many queries are shown as it holds, the worst and the best first",
        low=0.1,
        high=2000,
    )


@dataclass
class Config(Checked):
    """The whole configuration."""

    group: ClassVar[str | None] = ""

    name: str = option("run", "names the output folder")
    mode: str = option("paper", "named set of switches", choices=("paper", "tuned", "raw", "best"))
    seed: int = option(
        0, "of everything random: k-means, autoencoders, ties, controls, bootstrap", low=0, high=2**32 - 1
    )
    workers: int = option(0, "parallel workers; 0: one per core. Never changes a result", low=0, high=1024)
    device: str = option("cpu", "where torch runs: cpu or cuda")
    store: str = option("outputs/store", "folder of the artefacts that a second run reuses")
    learned: int = option(
        0,
        "the first images of the map, which places, autoencoders, centring and early fusion learn from; it may then "
        "grow without its photos. 0: all",
        low=0,
    )
    dataset: Dataset = field(default_factory=Dataset)
    obb: Obb = field(default_factory=Obb)
    bow: Bow = field(default_factory=Bow)
    fd: Fd = field(default_factory=Fd)
    pc: Pc = field(default_factory=Pc)
    ad: Ad = field(default_factory=Ad)
    compact: Compact = field(default_factory=Compact)
    early: Early = field(default_factory=Early)
    mix: Mix = field(default_factory=Mix)
    mask: Mask = field(default_factory=Mask)
    evaluation: Evaluation = field(default_factory=Evaluation)
    report: Report = field(default_factory=Report)
    tracker: Tracker = field(default_factory=Tracker)


def register() -> None:
    """Tell Hydra the schema: call once before composing."""
    store = ConfigStore.instance()
    store.store(name="schema", node=Config)
    for node in DATASETS:
        store.store(group="dataset", name=f"base_{node.kind}", node=node)
