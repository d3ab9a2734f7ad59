"""Queries in a map: localised, looked at by every detector, and what these found fused and masked.

Pure steps between a map and the measuring of what was found; the pipeline and the library take the same ones.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.compact.source import Source
from fdslam.config import Config
from fdslam.context import Context
from fdslam.controls import CONTROLS, control, objectness
from fdslam.detectors.registry import DETECTORS
from fdslam.fusion import fuse
from fdslam.hypotheses import hypotheses
from fdslam.mapping import BowMap
from fdslam.mask import apply_masks, load_masks
from fdslam.models import Models
from fdslam.obb import parse_library
from fdslam.provenance import Stopwatch
from fdslam.sessions import identities
from fdslam.store import Key, Store
from fdslam.types import Boxes, Dataset, Localization

Maps = list[NDArray[np.floating]]  # per query, LoC of its cells


@dataclass(frozen=True)
class Located:
    """One pair of sessions, localised."""

    dataset: Dataset
    localizations: tuple[Localization, ...]
    keys: tuple[Key, ...]  # per query, addresses of the above
    masks: list[NDArray[np.bool_]] | None
    bow: BowMap
    kept: float  # bytes of the bag of words per map image
    looks: Source | None  # of dense descriptors


@dataclass(frozen=True)
class Seen:
    """One pair of sessions, looked at by every detector."""

    located: Located
    hypotheses: tuple[NDArray[np.int64], ...]
    found: dict[str, Maps]  # per detector
    kept: dict[str, float]


class Fused(Mapping[str, Maps]):
    """The maps of every row and control. Each is made when it is asked for: those of a large pool together fill GBs."""

    def __init__(self, config: Config, seen: Sequence[Seen]) -> None:
        self._rows, self._rule, self._seed = config.mix.rows, config.mix.rule, config.seed
        self._methods = (*config.mix.rows, *CONTROLS, "objectness")
        self._found = {name: [cells for one in seen for cells in one.found[name]] for name in seen[0].found}
        located = [one.located for one in seen]
        self.masks = None if located[0].masks is None else tuple(mask for one in located for mask in one.masks or ())
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
        return apply_masks(self._made(name), self.masks)

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


def locate(
    config: Config, dataset: Dataset, models: Models, store: Store, watch: Stopwatch, bow: BowMap | None = None
) -> Located:
    """Localise the queries of a data set in its map.

    Args:
        config: the whole configuration.
        dataset: one pair of sessions.
        models: those of the configuration.
        store: of what is found.
        watch: takes the time.
        bow: the map, where it is at hand; it is built, or found in the store, otherwise.

    Raises:
        InputError: an image that cannot be read, or a query without the label image that the mask wants.
    """
    with watch.stage("data"):
        masks = load_masks(dataset, config.mask, models.segmentation, store, config.workers)
    with watch.stage("map and localisation"):
        bow = bow or BowMap(dataset.map, config.bow, models.library, store, config.workers)
        keys, localizations = bow.localize(dataset.query)
        return Located(dataset, tuple(localizations), tuple(keys), masks, bow, bow.kept(), models.looks)


def context_of(config: Config, located: Located, store: Store) -> Context:
    """Return what detectors work with."""
    found_at = hypotheses(config.evaluation, located.dataset, located.localizations)
    return Context(
        config, located.dataset, store, located.localizations, located.keys, found_at, located.bow, located.looks
    )


def see(config: Config, located: Located, store: Store, watch: Stopwatch) -> Seen:
    """Let every detector of the mix look at the queries."""
    context = context_of(config, located, store)
    found: dict[str, Maps] = {}
    kept = {"bag of words": located.kept}
    for name in config.mix.detectors:
        with watch.stage(name):
            detected = DETECTORS[name].detect(context)
            found[name], kept[name] = list(detected.loc), detected.kept
    return Seen(located, context.hypotheses, found, kept)


def _objects(boxes: Boxes, library: str) -> NDArray[np.float32]:
    """Return the boxes that objectness counts: YOLO's or, where the library does without, all OBBs.

    An image where YOLO finds nothing has none; with fixed templates alone objectness is a fixed map.
    """
    if "YOLO" not in parse_library(library):
        return boxes.xyxy
    return boxes.xyxy[np.array([source == "YOLO" for source in boxes.source], bool)]
