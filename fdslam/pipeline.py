"""The stages in order: data, map, localisation, detectors, fusion, mask, evaluation. Usable without Hydra."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.config import Config
from fdslam.context import Context
from fdslam.controls import CONTROLS, control, objectness
from fdslam.data import load_datasets
from fdslam.detectors import DETECTORS
from fdslam.errors import InputError
from fdslam.fusion import fuse
from fdslam.mapping import BowMap
from fdslam.mask import apply_masks, load_masks
from fdslam.metrics import Figure, Leader, Row, Scene, evaluate, leaders, proportion
from fdslam.progress import progress, single_threaded
from fdslam.provenance import Stopwatch
from fdslam.store import Store
from fdslam.types import Dataset, Localization

RECALL_AT = (1, 5, 10)
Maps = list[NDArray[np.floating]]  # per query, LoC of its cells


@dataclass(frozen=True)
class Outcome:
    """What a run has found."""

    dataset: Dataset
    localizations: tuple[Localization, ...]  # per query
    hypotheses: tuple[NDArray[np.int64], ...]  # per query up to Y map ids, best first
    recall: dict[int, Figure | None]  # n -> percent of the queries with a true place in the first n of the strong list
    maps: dict[str, Maps]  # per row of the table and per control, after the mask
    rows: tuple[Row, ...]  # methods, then controls; empty without annotations
    leaders: dict[str, Leader]  # per method; empty without annotated boxes
    kept: dict[str, float]  # bytes per map image of the bag of words, and what each detector keeps beside it


def run(config: Config, watch: Stopwatch) -> Outcome:
    """Run the whole way for one map and one query session.

    What is stored from earlier runs is used, so only what is new is computed.

    Raises:
        InputError: bad data or configuration, in one line.
    """
    single_threaded()
    store = Store(config.store)
    with watch.stage("data"):
        [dataset] = load_datasets(config.dataset, store, config.workers)
        _check_truth(config, dataset)
        masks = load_masks(dataset, config.mask)
    with watch.stage("map and localisation"):
        bow = BowMap(dataset.map, config.bow, config.obb.library, store, config.workers)
        keys, localizations = bow.localize(dataset.query)
    hypotheses = _hypotheses(config, dataset, localizations)
    context = Context(config, dataset, store, tuple(localizations), tuple(keys), hypotheses)
    found: dict[str, Maps] = {}
    kept = {"bag of words": bow.kept()}
    for name in dict.fromkeys(part for row in config.mix.rows for part in row.split("+")):
        with watch.stage(name):
            detected = DETECTORS[name](context)
            found[name], kept[name] = list(detected.loc), detected.kept
    with watch.stage("fusion"):
        maps = {row: _row(row, found, config.mix.rule) for row in config.mix.rows}
        maps |= _controls(dataset, localizations, config.seed)
        maps = {name: apply_masks(loc, masks) for name, loc in maps.items()}
    with watch.stage("evaluation"):
        rows = _evaluate(maps, dataset, config)
        recall = {n: _recall(n, dataset, localizations, config) for n in RECALL_AT}
        grades = {row.method: row.grades for row in rows if row.method in config.mix.rows}
        lead = leaders(grades, otherwise=len(set(config.evaluation.X))) or {}
    return Outcome(dataset, tuple(localizations), hypotheses, recall, maps, tuple(rows), lead, kept)


def _check_truth(config: Config, dataset: Dataset) -> None:
    """Find at the start, not after an hour, that the configuration wants truth which the data set does not have."""
    if config.evaluation.viewpoint == "true" and dataset.relevant is None:
        raise InputError(
            f"evaluation.viewpoint=true: {dataset.name} has no place ground truth; add map.csv and pairs.csv to the "
            "data set or run with evaluation.viewpoint=predicted"
        )
    if config.ad.places == "pose" and dataset.poses is None and any("AD" in row for row in config.mix.rows):
        raise InputError(
            f"ad=pose: {dataset.name} has no poses; add x, y, heading to map.csv or choose ad=appearance or ad=time"
        )


def _hypotheses(config: Config, dataset: Dataset, found: list[Localization]) -> tuple[NDArray[np.int64], ...]:
    """Top-Y of the strong list or, for ``viewpoint: true``, of the true place (empty where the map lacks it)."""
    if config.evaluation.viewpoint == "predicted":
        return tuple(one.strong[: config.evaluation.Y].astype(np.int64) for one in found)
    assert dataset.relevant is not None  # by _check_truth
    return tuple(places[: config.evaluation.Y] for places in dataset.relevant)


def _row(row: str, found: dict[str, Maps], rule: str) -> Maps:
    names = row.split("+")
    return found[row] if len(names) == 1 else list(fuse([found[name] for name in names], rule))


def _controls(dataset: Dataset, found: list[Localization], seed: int) -> dict[str, Maps]:
    """LoC that knows nothing of the map: whatever does not beat it has shown nothing (§Performance).

    Objectness counts the OBBs of the library; with fixed templates alone that is a fixed map.
    """
    names, heights, widths = zip(*((frame.name, frame.height, frame.width) for frame in dataset.query), strict=True)
    maps: dict[str, Maps] = {kind: list(control(kind, names, heights, widths, seed)) for kind in CONTROLS}
    maps["objectness"] = [objectness(one.library, h, w) for one, h, w in zip(found, heights, widths, strict=True)]
    return maps


def _evaluate(maps: dict[str, Maps], dataset: Dataset, config: Config) -> list[Row]:
    if dataset.boxes is None:
        return []
    scene = Scene(
        tuple(frame.name for frame in dataset.query),
        tuple(frame.height for frame in dataset.query),
        tuple(frame.width for frame in dataset.query),
        dataset.boxes,
    )
    return list(
        progress(
            (evaluate(name, loc, scene, config.evaluation, config.seed) for name, loc in maps.items()),
            len(maps),
            "evaluation",
        )
    )


def _recall(n: int, dataset: Dataset, found: list[Localization], config: Config) -> Figure | None:
    if dataset.relevant is None:
        return None
    hits = np.array(
        [
            not one.lost and np.isin(one.strong[:n], true).any()
            for one, true in zip(found, dataset.relevant, strict=True)
        ]
    )
    names = [frame.name for frame in dataset.query]
    return proportion(hits, names, config.evaluation.bootstrap, config.evaluation.confidence, config.seed)
