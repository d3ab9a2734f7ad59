"""The stages in order: data, map, localisation, detectors, fusion, mask, evaluation. Usable without Hydra."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fdslam.compact.jpeg import grey_jpeg
from fdslam.config import Config
from fdslam.context import learned
from fdslam.data import load_datasets, outline, outline_of
from fdslam.errors import InputError
from fdslam.estimate import announce
from fdslam.metrics import Figure, Leader, Row, Scene, evaluate, leaders, proportion
from fdslam.models import Models, load_models
from fdslam.progress import progress, single_threaded
from fdslam.provenance import Stopwatch
from fdslam.queries import Fused, Located, Maps, Seen, locate, see
from fdslam.sessions import identities, joined
from fdslam.store import Store
from fdslam.todo import everything, remaining
from fdslam.training import Training, training_of
from fdslam.types import Dataset, Localization

RECALL_AT = (1, 5, 10)
FEWEST_DRAWS = 10  # of a bootstrap whose intervals nobody reads


@dataclass(frozen=True)
class Outcome:
    """What a run has found."""

    dataset: Dataset  # of several pairs of sessions: all queries, and the maps one after another
    localizations: tuple[Localization, ...]  # per query, in the map of its pair
    hypotheses: tuple[NDArray[np.int64], ...]  # per query up to Y map ids of ``dataset``, best first
    recall: dict[int, Figure | None]  # n -> percent of the queries with a true place in the first n of the strong list
    maps: Mapping[str, Maps]  # per row of the table and per control, after the mask; made when asked for
    rows: tuple[Row, ...]  # methods, then controls; empty without annotations
    leaders: dict[str, Leader]  # per method; empty without annotated boxes
    kept: dict[str, float]  # bytes per map image of the bag of words, and what each detector keeps beside it
    jpeg: float = 0.0  # bytes of a map image as a grey JPEG, to compare with; 0 where no compact map is kept
    pairs: tuple[Outcome, ...] = ()  # the same of each pair of sessions alone, where there are several
    over_Y: dict[int, tuple[Row, ...]] = field(default_factory=dict)  # rows at other numbers of hypotheses
    masks: tuple[NDArray[np.bool_], ...] | None = None  # per query which cells are masked; None: no mask
    training: tuple[Training, ...] = ()  # per place of every map, how its autoencoder was trained


def run(config: Config, watch: Stopwatch, models: Models | None = None) -> Outcome:
    """Run the whole way for every pair of a query and a map session.

    What is stored from earlier runs is used, so only what is new is computed.

    Args:
        config: the whole configuration.
        watch: takes the time of every stage.
        models: those of the configuration, where they are at hand; they are read otherwise.

    Raises:
        InputError: bad data or configuration, in one line.
    """
    single_threaded()
    store = Store(config.store)
    with watch.stage("data"):
        models = models or load_models(config)
        sizes = outline_of(config.dataset, store)
        if sizes is not None and sizes.missing:
            watch.expected = announce(config, sizes, everything(config, sizes), store)
        datasets = load_datasets(config.dataset, store, config.workers)
        for dataset in datasets:
            check_data(config, dataset)
        if sizes is None or sizes.missing < sizes.images:
            todo = remaining(config, datasets, models.library, models.segmentation, store, models.looks)
            watch.expected = announce(config, outline(datasets), todo, store)
    located = [locate(config, dataset, models, store, watch) for dataset in datasets]
    seen = [see(config, one, store, watch) for one in located]
    # Pairs without annotations, where others have some, have no part in the table of all.
    annotated = [one for one in seen if one.located.dataset.boxes is not None] or seen
    outcome = outcome_of(config, annotated, watch)
    pairs = tuple(outcome_of(config, [one], watch) for one in seen) if len(seen) > 1 else ()
    over = _over_Y(config, outcome, [one.located for one in annotated], store, watch)
    training: tuple[Training, ...] = ()
    if "AD" in config.mix.detectors:
        with watch.stage("AD"):
            training = training_of(config, datasets, store)
    jpeg = grey_jpeg(outcome.dataset.map) if config.mix.compact else 0.0
    return replace(outcome, pairs=pairs, over_Y=over, jpeg=jpeg, training=training)


def outcome_of(config: Config, seen: Sequence[Seen], watch: Stopwatch) -> Outcome:
    """Fuse, mask and measure: all cells of all queries of these pairs are one pool."""
    datasets = [one.located.dataset for one in seen]
    dataset = joined(datasets)
    localizations = tuple(found for one in seen for found in one.located.localizations)
    maps = Fused(config, seen)
    names = identities(datasets)
    with watch.stage("fusion and evaluation"):
        rows = _evaluate(maps, [*maps], dataset, names, config)
        recall = {n: _recall(n, [one.located for one in seen], names, config) for n in RECALL_AT}
        grades = {row.method: row.grades for row in rows if row.method in config.mix.rows}
        lead = leaders(grades, otherwise=len(set(config.evaluation.X))) or {}
    images = np.array([len(one.map) for one in datasets])
    kept = {name: float(np.average([one.kept[name] for one in seen], weights=images)) for name in seen[0].kept}
    starts = np.cumsum(images) - images
    shifted = tuple(h + start for one, start in zip(seen, starts, strict=True) for h in one.hypotheses)
    return Outcome(dataset, localizations, shifted, recall, maps, tuple(rows), lead, kept, masks=maps.masks)


def _over_Y(
    config: Config, outcome: Outcome, located: Sequence[Located], store: Store, watch: Stopwatch
) -> dict[int, tuple[Row, ...]]:
    """Return the methods' rows at each Y of ``evaluation.curve_Y``; their intervals are not used, so draws are few."""
    rows: dict[int, tuple[Row, ...]] = {}
    names = identities([one.dataset for one in located])
    for y in sorted(set(config.evaluation.curve_Y)) if outcome.rows else ():
        if y == config.evaluation.Y:
            rows[y] = tuple(row for row in outcome.rows if row.method in config.mix.rows)
            continue
        other = replace(config, evaluation=replace(config.evaluation, Y=y, bootstrap=FEWEST_DRAWS))
        maps = Fused(other, [see(other, one, store, watch) for one in located])
        with watch.stage("fusion and evaluation"):
            rows[y] = tuple(_evaluate(maps, config.mix.rows, outcome.dataset, names, other))
        del maps  # before the next are made
    return rows


def check_data(config: Config, dataset: Dataset) -> None:
    """Find at the start, not after an hour, that the configuration wants what the data set does not have."""
    learned(config, len(dataset.map))
    if config.evaluation.viewpoint == "true" and dataset.relevant is None:
        raise InputError(
            f"evaluation.viewpoint=true: {dataset.name} has no place ground truth; add map.csv and pairs.csv to the "
            "data set or run with evaluation.viewpoint=predicted"
        )
    if config.ad.places == "pose" and dataset.poses is None and "AD" in config.mix.detectors:
        raise InputError(
            f"ad=pose: {dataset.name} has no poses; add x, y, heading to map.csv or choose ad=appearance or ad=time"
        )


def _evaluate(
    maps: Mapping[str, Maps], methods: Sequence[str], dataset: Dataset, names: list[str], config: Config
) -> list[Row]:
    if dataset.boxes is None:
        return []
    scene = Scene.of(dataset, names)
    measured = (evaluate(name, maps[name], scene, config.evaluation, config.seed) for name in methods)
    return list(progress(measured, len(methods), "evaluation"))


def _recall(n: int, located: Sequence[Located], names: list[str], config: Config) -> Figure | None:
    if any(one.dataset.relevant is None for one in located):
        return None
    hits = np.array(
        [
            not found.lost and np.isin(found.strong[:n], true).any()
            for one in located
            for found, true in zip(one.localizations, one.dataset.relevant or (), strict=True)
        ]
    )
    images = [frame.digest for one in located for frame in one.dataset.query]
    drawn = config.evaluation
    return proportion(hits, names, drawn.bootstrap, drawn.confidence, config.seed, images)
