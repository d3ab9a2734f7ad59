"""What a detector works with: the data, the switches, the store and where each query was localised."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fdslam.config import Config
from fdslam.progress import in_parallel, progress
from fdslam.store import Arrays, Key, Stage, Store
from fdslam.types import Dataset, Localization


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


@dataclass(frozen=True)
class Context:
    """One run, as far as detectors are concerned."""

    config: Config
    dataset: Dataset
    store: Store
    localizations: tuple[Localization, ...]  # per query
    localization_keys: tuple[Key, ...]  # per query, addresses of the above
    hypotheses: tuple[NDArray[np.int64], ...]  # per query up to Y map ids, best first

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
