"""The stages in order: data, map, localisation, detectors, fusion, mask, evaluation. Usable without Hydra."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

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
from fdslam.sessions import images_of, joined
from fdslam.store import Store
from fdslam.types import Dataset, Localization

RECALL_AT = (1, 5, 10)
FEWEST_DRAWS = 10  # of a bootstrap whose intervals nobody reads
Maps = list[NDArray[np.floating]]  # per query, LoC of its cells


@dataclass(frozen=True)
class Outcome:
    """What a run has found."""

    dataset: Dataset  # of several pairs of sessions: all queries, and the maps one after another
    localizations: tuple[Localization, ...]  # per query, in the map of its pair
    hypotheses: tuple[NDArray[np.int64], ...]  # per query up to Y map ids of ``dataset``, best first
    recall: dict[int, Figure | None]  # n -> percent of the queries with a true place in the first n of the strong list
    maps: dict[str, Maps]  # per row of the table and per control, after the mask
    rows: tuple[Row, ...]  # methods, then controls; empty without annotations
    leaders: dict[str, Leader]  # per method; empty without annotated boxes
    kept: dict[str, float]  # bytes per map image of the bag of words, and what each detector keeps beside it
    pairs: tuple[Outcome, ...] = ()  # the same, less ``maps``, of each pair of sessions alone, where there are several
    over_Y: dict[int, tuple[Row, ...]] = field(default_factory=dict)  # rows at other numbers of hypotheses


@dataclass(frozen=True)
class _Seen:
    """One pair of sessions, localised and looked at by every detector."""

    dataset: Dataset
    localizations: tuple[Localization, ...]
    hypotheses: tuple[NDArray[np.int64], ...]
    found: dict[str, Maps]  # per detector
    masks: list[NDArray[np.bool_]] | None
    kept: dict[str, float]


def run(config: Config, watch: Stopwatch) -> Outcome:
    """Run the whole way for every pair of a query and a map session.

    What is stored from earlier runs is used, so only what is new is computed.

    Raises:
        InputError: bad data or configuration, in one line.
    """
    single_threaded()
    store = Store(config.store)
    with watch.stage("data"):
        datasets = load_datasets(config.dataset, store, config.workers)
        for dataset in datasets:
            _check_truth(config, dataset)
    seen = [_see(config, dataset, store, watch) for dataset in datasets]
    # Pairs without annotations, where others have some, have no part in the table of all.
    annotated = [one for one in seen if one.dataset.boxes is not None] or seen
    outcome = _outcome(config, annotated, watch)
    pairs = tuple(replace(_outcome(config, [one], watch), maps={}) for one in seen) if len(seen) > 1 else ()
    over = _over_Y(config, outcome, [one.dataset for one in annotated], store, watch)
    return replace(outcome, pairs=pairs, over_Y=over)


def _see(config: Config, dataset: Dataset, store: Store, watch: Stopwatch) -> _Seen:
    with watch.stage("data"):
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
    return _Seen(dataset, context.localizations, hypotheses, found, masks, kept)


def _outcome(config: Config, seen: Sequence[_Seen], watch: Stopwatch) -> Outcome:
    """Fuse, mask and measure: all cells of all queries of these pairs are one pool."""
    dataset = joined([one.dataset for one in seen])
    localizations = tuple(found for one in seen for found in one.localizations)
    with watch.stage("fusion"):
        found = {name: [cells for one in seen for cells in one.found[name]] for name in seen[0].found}
        masks = None if seen[0].masks is None else [mask for one in seen for mask in one.masks or ()]
        maps = {row: _row(row, found, config.mix.rule) for row in config.mix.rows}
        maps |= _controls(dataset, localizations, config.seed)
        maps = {name: apply_masks(loc, masks) for name, loc in maps.items()}
    with watch.stage("evaluation"):
        rows = _evaluate(maps, dataset, config)
        recall = {n: _recall(n, seen, dataset, config) for n in RECALL_AT}
        grades = {row.method: row.grades for row in rows if row.method in config.mix.rows}
        lead = leaders(grades, otherwise=len(set(config.evaluation.X))) or {}
    images = np.array([len(one.dataset.map) for one in seen])
    kept = {name: float(np.average([one.kept[name] for one in seen], weights=images)) for name in seen[0].kept}
    starts = np.cumsum(images) - images
    hypotheses = tuple(h + start for one, start in zip(seen, starts, strict=True) for h in one.hypotheses)
    return Outcome(dataset, localizations, hypotheses, recall, maps, tuple(rows), lead, kept)


def _over_Y(
    config: Config, outcome: Outcome, datasets: Sequence[Dataset], store: Store, watch: Stopwatch
) -> dict[int, tuple[Row, ...]]:
    """Return the rows at each Y of ``evaluation.curve_Y``; their intervals are not used, so they are few draws."""
    rows: dict[int, tuple[Row, ...]] = {}
    for y in sorted(set(config.evaluation.curve_Y)) if outcome.rows else ():
        if y == config.evaluation.Y:
            rows[y] = outcome.rows
            continue
        other = replace(config, evaluation=replace(config.evaluation, Y=y, bootstrap=FEWEST_DRAWS))
        rows[y] = _outcome(other, [_see(other, dataset, store, watch) for dataset in datasets], watch).rows
    return rows


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


def _controls(dataset: Dataset, found: Sequence[Localization], seed: int) -> dict[str, Maps]:
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
        tuple(images_of(dataset)),
    )
    return list(
        progress(
            (evaluate(name, loc, scene, config.evaluation, config.seed) for name, loc in maps.items()),
            len(maps),
            "evaluation",
        )
    )


def _recall(n: int, seen: Sequence[_Seen], dataset: Dataset, config: Config) -> Figure | None:
    if dataset.relevant is None:
        return None
    hits = np.array(
        [
            not found.lost and np.isin(found.strong[:n], true).any()
            for one in seen
            for found, true in zip(one.localizations, one.dataset.relevant or (), strict=True)
        ]
    )
    names, drawn = [frame.name for frame in dataset.query], config.evaluation
    return proportion(hits, names, drawn.bootstrap, drawn.confidence, config.seed, images_of(dataset))
