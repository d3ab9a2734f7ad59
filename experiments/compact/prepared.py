"""A data set in mode best, localised and looked at, for experiments that exchange one thing at a time."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.ablation.ablation import GROUPS, mode
from fdslam.compact.map import CompactMap
from fdslam.config import Bing, Campus, Compact, Config, Dataset, Early, Folder, Mix, Obb, Yolo
from fdslam.context import Context
from fdslam.data import load_datasets
from fdslam.detectors.compact import compact_map
from fdslam.fusion import fuse
from fdslam.hypotheses import hypotheses
from fdslam.mapping import BowMap
from fdslam.metrics import Row, Scene, evaluate
from fdslam.models import load_models
from fdslam.store import Store

Maps = list[NDArray[np.floating]]  # per query, LoC of its cells
BOTH = "CC+EF"


@dataclass(frozen=True)
class Prepared:
    """A pair of sessions, localised."""

    context: Context
    kept: CompactMap


def options(description: str | None) -> argparse.ArgumentParser:
    """Return what every script on mode best asks for; ``description``: its docstring."""
    parser = argparse.ArgumentParser(description=(description or "").splitlines()[0])
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--yolo", default="", help="ONNX file of a detector; without it the shipped one")
    parser.add_argument("--bing", default="", help="BING filters; without them the shipped ones")
    parser.add_argument("--store", default="outputs/store")
    return parser


def configuration(folder: Path | None, yolo: str, bing: str, store: str) -> Config:
    """Return mode best for a folder or, with none, for the campus."""
    data: Dataset = Folder(root=str(folder)) if folder else Campus(kind="campus")
    switches = mode("best")
    kinds = {**GROUPS, "compact": Compact, "early": Early}
    groups = {name: kind(**switches.get(name, {})) for name, kind in kinds.items() if name != "mix"}
    obb = Obb("J+B+BING+YOLO", yolo=Yolo(weights=yolo), bing=Bing(filters=bing))
    mix = Mix(rows=["CC", "EF"], **switches["mix"])
    return Config(name="compact", dataset=data, obb=obb, mix=mix, store=store, workers=1, **groups)


def prepared(config: Config) -> Iterator[Prepared]:
    """Yield every pair of sessions of a configuration; what is stored is used."""
    store, models = Store(config.store), load_models(config)
    for data in load_datasets(config.dataset, store, config.workers):
        bow = BowMap(data.map, config.bow, models.library, store, config.workers)
        keys, found = bow.localize(data.query)
        best = hypotheses(config.evaluation, data, found)
        context = Context(config, data, store, tuple(found), tuple(keys), best, bow, models.looks)
        yield Prepared(context, compact_map(context))


def with_fusion(maps: dict[str, Maps], rule: str) -> dict[str, Maps]:
    """Return CC and EF, or what stands in their places, with their late fusion."""
    fused: Maps = list(fuse([maps["CC"], maps["EF"]], rule))
    return {**maps, BOTH: fused}


def scene(context: Context, queries: Sequence[int]) -> Scene:
    """Return what is true of some of the queries."""
    data = context.dataset
    assert data.boxes is not None
    some = replace(data, query=tuple(data.query[q] for q in queries), boxes=tuple(data.boxes[q] for q in queries))
    return Scene.of(some, [frame.name for frame in some.query])


def measured(name: str, maps: Maps, context: Context, queries: Sequence[int]) -> Row:
    """Measure the maps of some of the queries, which are their own pool, as the pipeline does."""
    config = context.config
    return evaluate(name, [maps[q] for q in queries], scene(context, queries), config.evaluation, config.seed)


def moved(ready: Prepared, best: Sequence[NDArray[np.int64]]) -> Context:
    """Return the same run with other hypotheses."""
    return replace(ready.context, hypotheses=tuple(best))
