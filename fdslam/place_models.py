"""The places of a map and their autoencoders (AE), as stored stages (§AD)."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fdslam.autoencoder.apart import train_apart
from fdslam.autoencoder.checkpoint import Checkpoints
from fdslam.autoencoder.network import input_size, prepare
from fdslam.autoencoder.places import PlaceModel, fill_statistics, fit_places
from fdslam.autoencoder.scoring import Statistics
from fdslam.autoencoder.together import train_together
from fdslam.config import Autoencoder, Places, part
from fdslam.context import Context, load
from fdslam.data.images import LIBRARIES, read_image
from fdslam.places import global_descriptor, nearest_places, place_classes, pose_vectors, time_vectors
from fdslam.progress import progress
from fdslam.store import Arrays, Key, Stage
from fdslam.types import Frame

DESCRIPTOR = Stage("global_descriptor", ("fdslam.places", "fdslam.data.images"), LIBRARIES)
PLACES = Stage("places", ("fdslam.places",), ("scikit-learn", "scipy", "numpy"))
MODEL = Stage(
    "autoencoder",
    ("fdslam.autoencoder.places", "fdslam.autoencoder.together", "fdslam.data.images"),
    ("torch", "kornia", *LIBRARIES),
)
# What every query asks of all AEs, so that only the AEs of its own places have to be read.
SUMMARY = Stage("autoencoder_summary", ("fdslam.autoencoder.places",))


@dataclass(frozen=True)
class PlaceModels:
    """The map's places with their AEs, of which each is read when it is first asked for. Threads may share it."""

    label: NDArray[np.int64]  # [M] the place of every map image
    keys: list[Key]  # per place, the address of its AE
    held_out: tuple[Statistics, ...]  # per place, filled in
    nbytes: int  # of the weights of all AEs
    size: tuple[int, int]  # of the AEs' input, height and width in pixels
    read: Callable[[int], PlaceModel]  # from the place to its AE
    known: dict[int, PlaceModel] = field(default_factory=dict)  # those that were read
    lock: threading.Lock = field(default_factory=threading.Lock)

    def model(self, place: int) -> PlaceModel:
        """Return the AE of a place, the statistics filled in."""
        with self.lock:  # two threads would read it twice, or train it twice if it is damaged
            if place not in self.known:
                self.known[place] = replace(self.read(place), held_out=self.held_out[place])
            return self.known[place]

    @property
    def models(self) -> tuple[PlaceModel, ...]:
        """All AEs, per place."""
        return tuple(map(self.model, range(len(self.keys))))


def _vectors(context: Context) -> NDArray[np.floating]:
    """What k-means partitions: [M, d]."""
    data, settings = context.dataset, context.config.ad
    if settings.places == "time":
        return time_vectors(data.times)
    if settings.places == "pose":
        assert data.poses is not None  # the pipeline has checked what the configuration wants
        return pose_vectors(data.poses)

    def describe(image: int) -> Arrays:
        return {"vector": global_descriptor(read_image(data.map[image].path))}

    keys = [DESCRIPTOR.key({}, [frame.digest]) for frame in data.map]
    found = context.fetch(DESCRIPTOR, keys, describe, "global descriptors of the map")
    return np.stack([arrays["vector"] for arrays in found])


def _places_key(context: Context) -> Key:
    inputs = [frame.digest for frame in context.dataset.map]
    if context.config.ad.places != "appearance":
        inputs += [value.hex() for value in _vectors(context).ravel().tolist()]
    return PLACES.key({**part(context.config.ad, Places), "seed": context.config.seed}, inputs)


def place_labels(context: Context) -> NDArray[np.int64]:
    """Return the place of every map image, int64 [M], 0 … at most k - 1."""
    config, then = context.config, context.learned()

    def cluster() -> Arrays:
        return {"label": place_classes(_vectors(then), config.ad.k, config.seed)}

    label = load(context.store, PLACES, _places_key(then), cluster)["label"]
    return label if then is context else nearest_places(_vectors(context), label)


def _input_size(context: Context) -> tuple[int, int]:
    first = context.dataset.map[0]
    return input_size(first.height, first.width, context.config.ad.pixels)


def _together(context: Context) -> bool:
    return context.config.ad.together(context.config.device)


def _members(context: Context, label: NDArray[np.int64]) -> tuple[list[list[Frame]], list[Key]]:
    """Return the map images of every place, and the address of its AE."""
    config = context.config
    members = [[context.dataset.map[m] for m in np.flatnonzero(label == place)] for place in range(label.max() + 1)]
    # A GPU rounds differently from a CPU, so their models are told apart; cuda:0 and cuda:1 are not.
    settings = {**part(config.ad, Autoencoder), "seed": config.seed, "device": config.device.split(":")[0]}
    settings["size"] = _input_size(context)
    # In one pass the last bits of an AE may depend on those beside it: all their images are then part of its address.
    beside = [f"{place}:{f.digest}" for place, frames in enumerate(members) for f in frames]
    group = ["together", *beside] if _together(context) else []
    return members, [MODEL.key(settings, [*(frame.digest for frame in frames), *group]) for frames in members]


def untrained(context: Context) -> int:
    """Count the map images that are trained on; all of them where the places are not known yet."""
    then = context.learned()
    every = len(then.dataset.map)
    arrays = context.store.get(PLACES, _places_key(then))
    if arrays is None:
        return every
    members, keys = _members(then, arrays["label"])
    lacking = [len(frames) for frames, key in zip(members, keys, strict=True) if context.store.lacks(MODEL, [key])]
    return every if lacking and _together(context) else sum(lacking)


def _pack(model: PlaceModel) -> Arrays:
    arrays: Arrays = {f"weights.{name}": value for name, value in model.weights.items()}
    for name, found in (("held_out", model.held_out), ("own", model.own)):
        arrays |= {f"{name}.{kind}": np.array(moments, np.float64) for kind, moments in found.items()}
    return arrays | {"epochs": np.array(model.epochs), "training": model.training, "validation": model.validation}


def _unpack(arrays: Arrays) -> PlaceModel:
    def named(prefix: str) -> Arrays:
        return {name.removeprefix(prefix): a for name, a in arrays.items() if name.startswith(prefix)}

    def moments(prefix: str) -> Statistics:
        return {kind: (float(mu), float(sigma)) for kind, (mu, sigma) in named(prefix).items()}

    return PlaceModel(
        named("weights."),
        moments("held_out."),
        moments("own."),
        int(arrays["epochs"]),
        arrays["training"],
        arrays["validation"],
    )


def trained_places(context: Context) -> PlaceModels:
    """Return the places with their AEs; those that are not stored yet are trained, from their checkpoints if any."""
    label, size, then = place_labels(context), _input_size(context), context.learned()
    members, keys = _members(then, label[: len(then.dataset.map)])
    store, address = context.store, SUMMARY.key({}, keys)

    def train() -> list[PlaceModel]:
        made = _train_together if _together(context) else _train_all_apart
        return [_unpack(one) for one in made(context, members, keys, size)]

    def read(place: int) -> PlaceModel:
        arrays = store.get(MODEL, keys[place])
        if arrays is not None:
            return _unpack(arrays)
        store.discard(SUMMARY, address)  # a GPU may train it to other last bits
        return train()[place]

    known: dict[int, PlaceModel] = {}
    summary = None if store.lacks(MODEL, keys) else store.get(SUMMARY, address)
    if summary is None:
        known = dict(enumerate(fill_statistics(train())))
        summary = _summary([*known.values()])
        store.put(SUMMARY, address, summary)
    kinds = [name for name in summary if name != "nbytes"]
    held_out = tuple(
        {kind: (float(summary[kind][p, 0]), float(summary[kind][p, 1])) for kind in kinds} for p in range(len(keys))
    )
    return PlaceModels(label, keys, held_out, int(summary["nbytes"]), size, read, known)


def _summary(models: list[PlaceModel]) -> Arrays:
    """Return μ and σ of each kind of error, float64 [places, 2], and the bytes of all weights."""
    found = {kind: np.array([model.held_out[kind] for model in models], np.float64) for kind in models[0].held_out}
    return found | {"nbytes": np.array(sum(w.nbytes for model in models for w in model.weights.values()))}


def _train_all_apart(
    context: Context, members: list[list[Frame]], keys: list[Key], size: tuple[int, int]
) -> list[Arrays]:
    # The largest first, or the last worker would be busy with it alone.
    order = sorted(range(len(keys)), key=lambda place: -len(members[place]))

    def train(position: int) -> Arrays:
        return _train_apart(context, members, keys, size, order[position])

    arrays = context.fetch(MODEL, [keys[place] for place in order], train, "autoencoders")
    return [arrays[order.index(place)] for place in range(len(keys))]


def _train_apart(
    context: Context, members: list[list[Frame]], keys: list[Key], size: tuple[int, int], place: int
) -> Arrays:
    config = context.config
    images = prepare((read_image(frame.path) for frame in members[place]), size)
    keeper = Checkpoints(context.store, keys[place])
    names = [_name(place, members[place])]
    [model] = fit_places([images], config.ad, config.seed, config.device, train_apart, keeper, names)
    arrays = _pack(model)
    context.store.put(MODEL, keys[place], arrays)  # before the checkpoints go: a kill between would lose both
    keeper.clear()
    return arrays


def _name(place: int, frames: list[Frame]) -> str:
    """Return how a message names a place."""
    images = f"{len(frames)} map images, the first " if len(frames) > 1 else ""
    return f"place {place} ({images}{frames[0].name})"


def _train_together(
    context: Context, members: list[list[Frame]], keys: list[Key], size: tuple[int, int]
) -> list[Arrays]:
    config, store = context.config, context.store
    stored = [store.get(MODEL, key) for key in keys]
    found = [arrays for arrays in stored if arrays is not None]
    if len(found) == len(keys):
        return found
    places = [
        prepare((read_image(frame.path) for frame in frames), size)
        for frames in progress(members, len(members), "images of the places")
    ]
    keeper = Checkpoints(store, keys[0])
    names = [_name(place, frames) for place, frames in enumerate(members)]
    models = fit_places(places, config.ad, config.seed, config.device, train_together, keeper, names)
    made = [_pack(model) for model in models]
    for key, old, new in zip(keys, stored, made, strict=True):
        if old is None:
            store.put(MODEL, key, new)
    keeper.clear()
    return [new if old is None else old for old, new in zip(stored, made, strict=True)]
