"""Train the shipped early fusion: python -m experiments.train.early_fusion [--source gradients] [KEY=VALUE …]

For maps that are too small to train on. It sees the cells of embedded worlds that no other training knows: of map
images with made-up changes, as on any map (*map*), of real queries from another season, labelled by their boxes
(*queries*), or both. All three are trained and measured on unseen worlds, and one is written.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save

from experiments.compact.prepared import prepared
from fdslam.compact.features import NAMES
from fdslam.compact.shipped import file_name
from fdslam.compact.training import NEITHER, fit, made_up_rows, sure_cells
from fdslam.compact.trees import Trees
from fdslam.compose import configured
from fdslam.config import Config
from fdslam.context import Context
from fdslam.detectors.compact import all_evidence, compact_map
from fdslam.detectors.compact import detect as compact_comparison
from fdslam.detectors.early import rows_of
from fdslam.errors import InputError
from fdslam.fusion import fuse
from fdslam.metrics import Row, Scene, box_overlap, evaluate, positive_cells
from fdslam.onnx_model import shipped
from fdslam.progress import single_threaded
from fdslam.run import USAGE_ERROR
from fdslam.store import write_atomically
from fdslam.types import Dataset

World = tuple[int, str, str]  # campus, season of the queries, season of the map
TRAINING: tuple[World, ...] = ((6000, "AU", "SU"), (6001, "SU", "WI"), (6002, "WI", "SP"))
VALIDATION: tuple[World, ...] = ((7000, "AU", "SU"),)
TEST: tuple[World, ...] = ((4, "AU", "SU"), (0, "AU", "SU"))  # looked at when all was chosen; 4 is that of the users
IMAGES = 32  # map images of a world of training that changes are made up in
KINDS = {"map": ("map",), "queries": ("queries",), "both": ("map", "queries")}  # of training data
Rows = tuple[NDArray[np.float32], NDArray[np.uint8]]  # features [n, len(NAMES)], labels [n]: 1 changed, 0 not


@dataclass(frozen=True)
class Cells:
    """Everything that is learned from, or measured on, one world."""

    name: str
    dataset: Dataset
    config: Config
    rows: Mapping[str, Rows]  # by kind of training data
    queries: list[NDArray[np.float32]]  # per query the features of its cells, [cells, len(NAMES)]
    compared: list[NDArray[np.floating]]  # per query the LoC of CC, to compare with


def opened(config: Config) -> Context:
    """Return a world with its queries localised, as a run would have it."""
    [ready] = prepared(config)
    return ready.context


def of_map(context: Context) -> Rows:
    """Return the cells of a world's map images with made-up changes, each localised without itself."""
    made = made_up_rows(context, compact_map(context))
    return sure_cells([one["features"] for one in made], [one["label"] for one in made])


def of_queries(context: Context) -> list[NDArray[np.float32]]:
    """Return the features of each query's cells, as the detector EF sees them."""
    return [*rows_of(context, all_evidence(context, compact_map(context)))]


def cell_labels(boxes: NDArray[np.float32], height: int, width: int) -> NDArray[np.uint8]:
    """Return the label of every cell of an image, uint8 [rows · cols].

    1 where the boxes (xyxy, [n, 4] pixels) make it positive, 0 where none touches it, NEITHER at their borders.
    """
    positive = positive_cells(boxes, height, width)
    touched = np.any([box_overlap(box, height, width) > 0 for box in boxes] or [np.zeros_like(positive)], axis=0)
    return np.where(positive, 1, np.where(touched, NEITHER, 0)).astype(np.uint8).ravel()


def cells(world: World, source: str, overrides: Sequence[str], images: int | None = None) -> Cells:
    """Return everything that is learned from, or measured on, one world; rendered and computed if it is not stored.

    Args:
        world: which.
        source: of the dense descriptors.
        overrides: further words for the configuration.
        images: map images that changes are made up in; None: as many as on any map, 0: none.

    Raises:
        InputError: a bad word, as one that names another data set.
    """
    seed, query, map_ = world
    chosen_world = f"dataset.seed={seed}", f"dataset.query={query}", f"dataset.map={map_}"
    config = configured(["mode=best", *chosen_world, f"compact.source={source}", *overrides])
    if images:
        config = replace(config, early=replace(config.early, images=images))
    context = opened(config)
    data = context.dataset
    assert data.boxes is not None  # of a campus
    each = of_queries(context)
    sizes = [(frame.height, frame.width) for frame in data.query]
    label = [cell_labels(boxes, *size) for boxes, size in zip(data.boxes, sizes, strict=True)]
    rows = {"queries": sure_cells(each, label)}
    if images != 0:
        rows["map"] = of_map(context)
    compared = list(compact_comparison(context).loc)
    return Cells(f"campus {seed}, {query} on {map_}", data, config, rows, each, compared)


def trained(worlds: Sequence[Cells], kinds: Sequence[str], seed: int) -> Trees:
    """Return trees trained on the cells of some worlds, those of the kinds of data that are named."""
    rows, label = (np.concatenate([world.rows[kind][i] for world in worlds for kind in kinds]) for i in range(2))
    return fit(rows, label, worlds[0].config.early, seed)


def looked_at(world: Cells, learner: Trees) -> list[NDArray[np.floating]]:
    """Return the LoC of every query by a learner, as the detector EF gives it."""
    every = zip(world.queries, world.compared, strict=True)
    return [learner.loc(rows, (cc.shape[0], cc.shape[1])) for rows, cc in every]


def figures(world: Cells, learners: Mapping[str, Trees]) -> Iterator[Row]:
    """Yield the figures on a world's queries: those of CC, then of each learner alone and fused with CC."""
    scene = Scene.of(world.dataset, [frame.name for frame in world.dataset.query])
    settings, seed = world.config.evaluation, world.config.seed
    yield evaluate("CC", world.compared, scene, settings, seed)
    for name, learner in learners.items():
        loc = looked_at(world, learner)
        yield evaluate(f"EF {name}", loc, scene, settings, seed)
        both = list(fuse([world.compared, loc], world.config.mix.rule))
        yield evaluate(f"CC+EF {name}", both, scene, settings, seed)


def table(world: Cells, learners: Mapping[str, Trees]) -> Iterator[str]:
    """Yield the lines of a world's table: CC, a learner of its map where it has one, and those that are given."""
    objects, queries = sum(map(len, world.dataset.boxes or ())), len(world.dataset.query)
    yield f"\n| {world.name}: {objects} objects, {queries} queries | X = 5/10/15/20 | lcAUC |\n|---|---|---|"
    own = {"of this map": trained([world], ["map"], world.config.seed)} if "map" in world.rows else {}
    for row in figures(world, {**own, **learners}):
        found = "/".join(f"{figure.value:.1f}" for figure in row.pooled.values() if figure)
        lc = row.lc_auroc
        yield f"| {row.method} | {found} | " + (f"{lc.value:.3f} ({lc.low:.3f} … {lc.high:.3f}) |" if lc else "|")


def write(path: Path, trees: Trees) -> None:
    """Write trees as the package reads them (``compact.shipped``); the same trees are always the same file."""
    arrays = {name: np.asarray(array, order="C") for name, array in trees.arrays().items()}
    write_atomically(path, save(arrays, metadata={"features": ",".join(NAMES)}))


def main(arguments: Sequence[str] | None = None) -> None:
    """Train, write, and print the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("overrides", nargs="*", metavar="KEY=VALUE", help="as for fdslam.run, e.g. store=DIR")
    parser.add_argument("--source", choices=("network", "gradients"), default="network", help="of dense descriptors")
    parser.add_argument("--data", choices=tuple(KINDS), default="both", help="what the written one is trained on")
    parser.add_argument("--worlds", type=int, default=len(TRAINING), help="how many are trained on")
    parser.add_argument("--images", type=int, default=IMAGES, help="map images of each with made-up changes")
    parser.add_argument("--out", type=Path, help="the file; default: that of the package")
    given = parser.parse_args(arguments)
    if given.worlds < 1 or given.images < 1:
        parser.error("--worlds and --images must be at least 1")
    single_threaded()
    begin = time.perf_counter()
    look = partial(cells, source=given.source, overrides=given.overrides)
    worlds = [look(world, images=given.images) for world in TRAINING[: given.worlds]]
    learners = {}
    for name, kinds in KINDS.items():
        learners[name] = trained(worlds, kinds, worlds[0].config.seed)
        label = np.concatenate([world.rows[kind][1] for world in worlds for kind in kinds])
        print(f"{name}: {len(label)} cells, {100 * label.mean():.1f} % changed", flush=True)
    path = given.out or shipped(file_name(given.source))
    write(path, learners[given.data])
    print(f"{path}: {path.stat().st_size} bytes, trained on {given.data}, {time.perf_counter() - begin:.0f} s")
    named = {f"shipped, {name}": learner for name, learner in learners.items()}
    unseen = [(world, 0) for world in VALIDATION] + [(world, None) for world in TEST]
    for world, images in unseen:
        for line in table(look(world, images=images), named):
            print(line, flush=True)


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        print(f"fdslam: {error}", file=sys.stderr)
        sys.exit(USAGE_ERROR)
