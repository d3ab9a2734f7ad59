"""Data sets: a plain dict from the configuration's name to a loader."""

from __future__ import annotations

from collections.abc import Callable

from fdslam import config
from fdslam.data.embedded import load_campus
from fdslam.data.folder import check_folder, read_folder
from fdslam.data.nclt import check_nclt, load_nclt, outline_nclt
from fdslam.data.outline import Outline, outline, outline_campus
from fdslam.data.pairs import check_pairs, read_pairs
from fdslam.store import Store
from fdslam.types import Dataset


def _load_folder(settings: config.Folder, store: Store, workers: int) -> tuple[Dataset, ...]:
    return (read_folder(settings.root, settings),)


def _load_pairs(settings: config.Pairs, store: Store, workers: int) -> tuple[Dataset, ...]:
    return (read_pairs(settings, workers),)


DATASETS: dict[str, Callable[..., tuple[Dataset, ...]]] = {
    "folder": _load_folder,
    "pairs": _load_pairs,
    "campus": load_campus,
    "nclt": load_nclt,
}
OUTLINES: dict[str, Callable[..., Outline]] = {"campus": outline_campus, "nclt": outline_nclt}
CHECKS: dict[str, Callable[..., None]] = {"folder": check_folder, "pairs": check_pairs, "nclt": check_nclt}


__all__ = ["Outline", "check_dataset", "load_datasets", "outline", "outline_of"]


def outline_of(settings: config.Dataset, store: Store) -> Outline | None:
    """Return the sizes of a data set whose images may have to be made; None: loading it tells, and costs little."""
    return OUTLINES[settings.kind](settings, store) if settings.kind in OUTLINES else None


def check_dataset(settings: config.Dataset) -> None:
    """Find in the first second what a data set lacks; raises InputError, in one line that says the way out."""
    if settings.kind in CHECKS:
        CHECKS[settings.kind](settings)


def load_datasets(settings: config.Dataset, store: Store, workers: int) -> tuple[Dataset, ...]:
    """Return what the configuration names, one data set for each pair of a query and a map session.

    The embedded world is rendered if it is not there yet.
    """
    return DATASETS[settings.kind](settings, store, workers)
