"""How the autoencoders of a run were trained, read from what is stored of them (§AD)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fdslam.config import Config
from fdslam.context import Context
from fdslam.place_models import MODEL, trained_places
from fdslam.store import Store
from fdslam.types import Dataset


@dataclass(frozen=True)
class Training:
    """The losses of one place's autoencoder: L1 of values in 0 … 1."""

    map: str  # the map session or, where there is but one, the data set
    place: int
    images: int  # of the map, in the place
    training: tuple[float, ...]  # of the final network on its augmented images, epoch after epoch
    held_out: tuple[float, ...]  # of each fold, the best of its epochs; empty where nothing was held out


def training_of(config: Config, datasets: Sequence[Dataset], store: Store) -> tuple[Training, ...]:
    """Return the losses of all places, each map once although several query sessions may be compared with it.

    Args:
        config: of the run.
        datasets: the pairs of sessions that AD has looked at, so that all is trained and stored.
        store: of the run.
    """
    found: dict[tuple[str, ...], list[Training]] = {}
    taken: set[str] = set()
    for data in datasets:
        places = trained_places(Context(config, data, store, (), (), ()))
        if (keys := tuple(places.keys)) in found:
            continue
        name = data.name if data.pair is None else data.pair[1]
        if name in taken:  # another choice of the session's images
            name = "/".join(data.pair or ()) or f"{name} {len(taken)}"
        taken.add(name)
        images = np.bincount(places.label, minlength=len(keys)).tolist()
        found[keys] = []
        for place, key in enumerate(keys):
            # Its own file, not the model that is at hand only if a query was shown to it.
            if (stored := store.get(MODEL, key)) is not None:
                losses = (tuple(stored[kind].tolist()) for kind in ("training", "validation"))
                found[keys].append(Training(name, place, images[place], *losses))
    return tuple(one for each in found.values() for one in each)
