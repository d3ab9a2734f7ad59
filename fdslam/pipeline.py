"""The stages in order: data, map, localisation, detectors, fusion, mask, evaluation. Usable without Hydra."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fdslam.compact.jpeg import grey_jpeg
from fdslam.compact.source import Source
from fdslam.config import Config
from fdslam.context import Context
from fdslam.controls import CONTROLS, control, objectness
from fdslam.data import load_datasets, outline, outline_of
from fdslam.detectors.registry import DETECTORS
from fdslam.errors import InputError
from fdslam.estimate import announce
from fdslam.fusion import fuse
from fdslam.hypotheses import hypotheses
from fdslam.mapping import BowMap
from fdslam.mask import apply_masks, load_masks
from fdslam.metrics import Figure, Leader, Row, Scene, evaluate, leaders, proportion
from fdslam.models import Models, load_models
from fdslam.obb import parse_library
from fdslam.progress import progress, single_threaded
from fdslam.provenance import Stopwatch
from fdslam.sessions import identities, joined
from fdslam.store import Key, Store
from fdslam.todo import everything, remaining
from fdslam.training import Training, training_of
from fdslam.types import Boxes, Dataset, Localization

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
    maps: Mapping[str, Maps]  # per row of the table and per control, after the mask; made when asked for
    rows: tuple[Row, ...]  # methods, then controls; empty without annotations
    leaders: dict[str, Leader]  # per method; empty without annotated boxes
    kept: dict[str, float]  # bytes per map image of the bag of words, and what each detector keeps beside it
    jpeg: float = 0.0  # bytes of a map image as a grey JPEG, to compare with; 0 where no compact map is kept
    pairs: tuple[Outcome, ...] = ()  # the same of each pair of sessions alone, where there are several
    over_Y: dict[int, tuple[Row, ...]] = field(default_factory=dict)  # rows at other numbers of hypotheses
    training: tuple[Training, ...] = ()  # per place of every map, how its autoencoder was trained


@dataclass(frozen=True)
class _Located:
    """One pair of sessions, localised."""

    dataset: Dataset
    localizations: tuple[Localization, ...]
    keys: tuple[Key, ...]  # per query, addresses of the above
    masks: list[NDArray[np.bool_]] | None
    bow: BowMap
    kept: float  # bytes of the bag of words per map image
    looks: Source | None  # of dense descriptors


@dataclass(frozen=True)
class _Seen:
    """One pair of sessions, looked at by every detector."""

    located: _Located
    hypotheses: tuple[NDArray[np.int64], ...]
    found: dict[str, Maps]  # per detector
    kept: dict[str, float]


class _Fused(Mapping[str, Maps]):
    """The maps of every row and control. Each is made when it is asked for: those of a large pool together fill GBs."""

    def __init__(self, config: Config, seen: Sequence[_Seen]) -> None:
        self._rows, self._rule, self._seed = config.mix.rows, config.mix.rule, config.seed
        self._methods = (*config.mix.rows, *CONTROLS, "objectness")
        self._found = {name: [cells for one in seen for cells in one.found[name]] for name in seen[0].found}
        located = [one.located for one in seen]
        self._masks = None if located[0].masks is None else [mask for one in located for mask in one.masks or ()]
        self._names = identities([one.dataset for one in located])
        self._frames = [frame for one in located for frame in one.dataset.query]
        self._obbs = [_objects(found.library, config.obb.library) for one in located for found in one.localizations]

    def __iter__(self) -> Iterator[str]:
        return iter(self._methods)

    def __len__(self) -> int:
        return len(self._methods)

    def __contains__(self, name: object) -> bool:  # the inherited one would make the maps
        return name in self._methods

    def __getitem__(self, name: str) -> Maps:
        return apply_masks(self._made(name), self._masks)

    def _made(self, name: str) -> Maps:
        if name in self._rows:
            parts = [self._found[part] for part in name.split("+")]
            return parts[0] if len(parts) == 1 else list(fuse(parts, self._rule))
        heights, widths = [frame.height for frame in self._frames], [frame.width for frame in self._frames]
        if name in CONTROLS:
            return list(control(name, self._names, heights, widths, self._seed))
        if name == "objectness":
            return [objectness(obbs, h, w) for obbs, h, w in zip(self._obbs, heights, widths, strict=True)]
        raise KeyError(name)


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
            check_truth(config, dataset)
        if sizes is None or sizes.missing < sizes.images:
            todo = remaining(config, datasets, models.library, models.segmentation, store, models.looks)
            watch.expected = announce(config, outline(datasets), todo, store)
    located = [_locate(config, dataset, models, store, watch) for dataset in datasets]
    seen = [_see(config, one, store, watch) for one in located]
    # Pairs without annotations, where others have some, have no part in the table of all.
    annotated = [one for one in seen if one.located.dataset.boxes is not None] or seen
    outcome = _outcome(config, annotated, watch)
    pairs = tuple(_outcome(config, [one], watch) for one in seen) if len(seen) > 1 else ()
    over = _over_Y(config, outcome, [one.located for one in annotated], store, watch)
    training: tuple[Training, ...] = ()
    if "AD" in config.mix.detectors:
        with watch.stage("AD"):
            training = training_of(config, datasets, store)
    return replace(outcome, pairs=pairs, over_Y=over, training=training)


def _locate(config: Config, dataset: Dataset, models: Models, store: Store, watch: Stopwatch) -> _Located:
    with watch.stage("data"):
        masks = load_masks(dataset, config.mask, models.segmentation, store, config.workers)
    with watch.stage("map and localisation"):
        bow = BowMap(dataset.map, config.bow, models.library, store, config.workers)
        keys, localizations = bow.localize(dataset.query)
        return _Located(dataset, tuple(localizations), tuple(keys), masks, bow, bow.kept(), models.looks)


def _see(config: Config, located: _Located, store: Store, watch: Stopwatch) -> _Seen:
    found_at = hypotheses(config.evaluation, located.dataset, located.localizations)
    context = Context(
        config, located.dataset, store, located.localizations, located.keys, found_at, located.bow, located.looks
    )
    found: dict[str, Maps] = {}
    kept = {"bag of words": located.kept}
    for name in config.mix.detectors:
        with watch.stage(name):
            detected = DETECTORS[name](context)
            found[name], kept[name] = list(detected.loc), detected.kept
    return _Seen(located, found_at, found, kept)


def _outcome(config: Config, seen: Sequence[_Seen], watch: Stopwatch) -> Outcome:
    """Fuse, mask and measure: all cells of all queries of these pairs are one pool."""
    datasets = [one.located.dataset for one in seen]
    dataset = joined(datasets)
    localizations = tuple(found for one in seen for found in one.located.localizations)
    maps = _Fused(config, seen)
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
    jpeg = grey_jpeg(dataset.map) if config.mix.compact else 0.0
    return Outcome(dataset, localizations, shifted, recall, maps, tuple(rows), lead, kept, jpeg)


def _over_Y(
    config: Config, outcome: Outcome, located: Sequence[_Located], store: Store, watch: Stopwatch
) -> dict[int, tuple[Row, ...]]:
    """Return the methods' rows at each Y of ``evaluation.curve_Y``; their intervals are not used, so draws are few."""
    rows: dict[int, tuple[Row, ...]] = {}
    names = identities([one.dataset for one in located])
    for y in sorted(set(config.evaluation.curve_Y)) if outcome.rows else ():
        if y == config.evaluation.Y:
            rows[y] = tuple(row for row in outcome.rows if row.method in config.mix.rows)
            continue
        other = replace(config, evaluation=replace(config.evaluation, Y=y, bootstrap=FEWEST_DRAWS))
        maps = _Fused(other, [_see(other, one, store, watch) for one in located])
        with watch.stage("fusion and evaluation"):
            rows[y] = tuple(_evaluate(maps, config.mix.rows, outcome.dataset, names, other))
        del maps  # before the next are made
    return rows


def check_truth(config: Config, dataset: Dataset) -> None:
    """Find at the start, not after an hour, that the configuration wants truth which the data set does not have."""
    if config.evaluation.viewpoint == "true" and dataset.relevant is None:
        raise InputError(
            f"evaluation.viewpoint=true: {dataset.name} has no place ground truth; add map.csv and pairs.csv to the "
            "data set or run with evaluation.viewpoint=predicted"
        )
    if config.ad.places == "pose" and dataset.poses is None and "AD" in config.mix.detectors:
        raise InputError(
            f"ad=pose: {dataset.name} has no poses; add x, y, heading to map.csv or choose ad=appearance or ad=time"
        )


def _objects(boxes: Boxes, library: str) -> NDArray[np.float32]:
    """Return the boxes that objectness counts: YOLO's or, where the library does without, all OBBs.

    An image where YOLO finds nothing has none; with fixed templates alone objectness is a fixed map.
    """
    if "YOLO" not in parse_library(library):
        return boxes.xyxy
    return boxes.xyxy[np.array([source == "YOLO" for source in boxes.source], bool)]


def _evaluate(
    maps: Mapping[str, Maps], methods: Sequence[str], dataset: Dataset, names: list[str], config: Config
) -> list[Row]:
    if dataset.boxes is None:
        return []
    scene = Scene.of(dataset, names)
    measured = (evaluate(name, maps[name], scene, config.evaluation, config.seed) for name in methods)
    return list(progress(measured, len(methods), "evaluation"))


def _recall(n: int, located: Sequence[_Located], names: list[str], config: Config) -> Figure | None:
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
