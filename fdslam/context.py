"""What a detector works with: the data, the switches, the store and where each query was localised."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fdslam.compact.source import Source
from fdslam.config import Config
from fdslam.errors import InputError
from fdslam.progress import in_parallel, progress
from fdslam.store import Arrays, Key, Stage, Store
from fdslam.types import Dataset, Features, Frame, Image, Localization


def ensure(store: Store, stage: Stage, jobs: Mapping[Key, Callable[[], Arrays]], workers: int, label: str) -> None:
    """Make and store every artefact that is not there yet, in parallel; what is finished survives any interruption."""
    missing = {key: job for key, job in jobs.items() if not store.has(stage, key)}

    def make(key: Key, job: Callable[[], Arrays]) -> None:
        store.put(stage, key, job())

    made = in_parallel((partial(make, key, job) for key, job in missing.items()), workers)
    for _ in progress(made, len(missing), label):
        pass


def load(store: Store, stage: Stage, key: Key, make: Callable[[], Arrays]) -> Arrays:
    """Return an artefact, making and storing it first if it is absent or damaged."""
    arrays = store.get(stage, key)
    if arrays is None:
        arrays = make()
        store.put(stage, key, arrays)
    return arrays


def learned(config: Config, images: int) -> int:
    """Return how many images of a map of so many are learned from: its first ones.

    Raises:
        InputError: more than there are.
    """
    if config.learned > images:
        raise InputError(f"learned={config.learned}: the map has {images} images; name at most as many, or 0 for all")
    return config.learned or images


class Words(Protocol):
    """What a map of words knows of keypoints: ``mapping.BowMap``, without its code in every detector's addresses."""

    def keypoints(self, frame: Frame) -> Features:
        """Return the keypoints of a query."""
        ...

    @property
    def identity(self) -> str:
        """Whatever decides the map and how queries are localised in it, as one address."""
        ...

    def placed_words(self, image: int) -> Features:
        """Return the words of a map image, where they were seen."""
        ...

    def posted(self, image: int) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Return which words a map image holds, int32 [n], and where, float32 [n, 2] pixels."""
        ...

    def descriptors(self, words: NDArray[np.int32]) -> NDArray[np.uint8]:
        """Return the descriptors of words, uint8 [n, 32]."""
        ...

    def born(self, image: int) -> tuple[int, int]:
        """Return the interval of the words that a map image gave the vocabulary."""
        ...

    def words_without(self, image: int, without: int) -> Features:
        """Return the words of a map image as they would be without another one."""
        ...

    def localize_without(self, image: Image, without: int) -> tuple[Features, Localization]:
        """Localise an image in the map without one of its images."""
        ...

    def kept_places(self) -> float:
        """Return the bytes per map image of which word was seen where."""
        ...

    def first(self, images: int) -> Words:
        """Return the map as it was when it held so many images."""
        ...


@dataclass(frozen=True)
class Context:
    """One run, as far as detectors are concerned."""

    config: Config
    dataset: Dataset
    store: Store
    localizations: tuple[Localization, ...]  # per query
    localization_keys: tuple[Key, ...]  # per query, addresses of the above
    hypotheses: tuple[NDArray[np.int64], ...]  # per query up to Y map ids, best first
    bow: Words | None = None  # for detectors that look at keypoints
    looks: Source | None = None  # for those that look at dense descriptors

    def learned(self) -> Context:
        """Return the run as it was when its map held none but the images that are learned from."""
        data, images = self.dataset, learned(self.config, len(self.dataset.map))
        if images == len(data.map):
            return self
        poses = None if data.poses is None else data.poses[:images]
        then = replace(data, map=data.map[:images], poses=poses, times=data.times[:images])
        return replace(self, dataset=then, bow=None if self.bow is None else self.bow.first(images))

    def fetch(self, stage: Stage, keys: Sequence[Key], make: Callable[[int], Arrays], label: str) -> list[Arrays]:
        """Return the artefacts of a stage, in the order of ``keys``, making those that are not there yet.

        Args:
            stage: what is made.
            keys: the address of each.
            make: from the position in ``keys`` to the artefact.
            label: for the progress bar.
        """
        jobs = {key: partial(make, i) for i, key in enumerate(keys)}
        ensure(self.store, stage, jobs, self.config.workers, label)
        return [load(self.store, stage, key, jobs[key]) for key in keys]


@dataclass(frozen=True)
class Detected:
    """What a detector has found, and what it keeps of the map for it."""

    loc: Sequence[NDArray[np.floating]]  # per query the LoC [rows, columns] of its cells
    kept: float  # bytes per map image beside the bag of words
