"""Several pairs of a query and a map session as one data set, for what is measured over all of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fdslam.types import Dataset


def label(dataset: Dataset) -> str:
    """Return how a pair of sessions is shown: query/map, e.g. "AU/SU"; empty where there are no sessions."""
    return "" if dataset.pair is None else "/".join(dataset.pair)


def map_images(dataset: Dataset) -> int:
    """Return how many different images the map has; in joined pairs a session's may stand several times."""
    return len({frame.name for frame in dataset.map})


def identities(datasets: Sequence[Dataset]) -> list[str]:
    """Return what tells the queries of all pairs apart and seeds what is random about them: image and pair.

    Not the name: one world gives one table, whatever its files are called and wherever they lie. Queries of a pair
    with the same content are told apart by the order of their names.
    """
    found = []
    for one in datasets:
        pair = label(one) if len(datasets) > 1 else ""  # alone it needs no name, and a folder has none
        times = Counter[str]()
        number: dict[str, int] = {}
        for frame in sorted(one.query, key=lambda frame: frame.name):
            number[frame.name] = times[frame.digest]
            times[frame.digest] += 1
        found += [f"{frame.digest} {number[frame.name]} {pair}" for frame in one.query]
    return found


def joined(datasets: Sequence[Dataset]) -> Dataset:
    """Return all queries of the pairs, and their maps one after another; one pair alone is returned as it is.

    A query image that is compared with three maps is three queries, told apart by their names. Truth that not all
    pairs have is left out.

    Args:
        datasets: at least one.
    """
    first = datasets[0]
    if len(datasets) == 1:
        return first
    starts = np.cumsum([0, *(len(one.map) for one in datasets)])
    placed = list(zip(datasets, starts, strict=False))
    known = all(one.relevant is not None for one in datasets)
    return Dataset(
        name=first.name,
        map=tuple(frame for one in datasets for frame in one.map),
        query=tuple(replace(frame, name=f"{frame.name} ({label(one)})") for one in datasets for frame in one.query),
        boxes=None
        if any(one.boxes is None for one in datasets)
        else tuple(boxes for one in datasets for boxes in one.boxes or ()),
        relevant=tuple(ids + start for one, start in placed for ids in one.relevant or ()) if known else None,
        labels=None,
        poses=None,
        times=np.concatenate([one.times for one in datasets]),
    )
