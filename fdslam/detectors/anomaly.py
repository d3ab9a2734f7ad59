"""Anomaly detection (AD): what the autoencoder of the place cannot reconstruct has changed (§AD).

The map images are partitioned into k places, each with its own autoencoder (AE). A query is shown to the AE of the
place it was localised in; z = (RE - μ) / (c σ) makes the AEs' errors comparable. c is shared by all AEs, so what is
stored is c z, and another c repeats nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from fdslam.autoencoder import (
    PlaceModel,
    error_to_cells,
    fill_statistics,
    fit_place,
    input_size,
    prepare,
    reconstruction_error,
    z_score,
)
from fdslam.config import Autoencoder, Places, part
from fdslam.context import Context, Detected, load
from fdslam.data.images import LIBRARIES, read_image
from fdslam.places import global_descriptor, place_classes, pose_vectors, time_vectors
from fdslam.store import Arrays, Key, Stage
from fdslam.types import Frame, grid_shape

DESCRIPTOR = Stage("global_descriptor", ("fdslam.places", "fdslam.data.images"), LIBRARIES)
PLACES = Stage("places", ("fdslam.places",), ("scikit-learn", "scipy", "numpy"))
MODEL = Stage("autoencoder", ("fdslam.autoencoder", "fdslam.data.images"), ("torch", *LIBRARIES))
STAGE = Stage("ad", ("fdslam.detectors.anomaly",), ("torch", *LIBRARIES))


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
    config = context.config

    def cluster() -> Arrays:
        return {"label": place_classes(_vectors(context), config.ad.k, config.seed)}

    return load(context.store, PLACES, _places_key(context), cluster)["label"]


def _input_size(context: Context) -> tuple[int, int]:
    first = context.dataset.map[0]
    return input_size(first.height, first.width, context.config.ad.pixels)


def _members(context: Context, label: NDArray[np.int64]) -> tuple[list[list[Frame]], list[Key]]:
    """Return the map images of every place, and the address of its AE."""
    config = context.config
    members = [[context.dataset.map[m] for m in np.flatnonzero(label == place)] for place in range(label.max() + 1)]
    # A GPU rounds differently from a CPU, so their models are told apart; cuda:0 and cuda:1 are not.
    settings = {**part(config.ad, Autoencoder), "seed": config.seed, "device": config.device.split(":")[0]}
    settings["size"] = _input_size(context)
    return members, [MODEL.key(settings, [frame.digest for frame in frames]) for frames in members]


def untrained(context: Context) -> int:
    """Count the map images in places whose AE is not stored; all of them where the places are not known yet."""
    arrays = context.store.get(PLACES, _places_key(context))
    if arrays is None:
        return len(context.dataset.map)
    members, keys = _members(context, arrays["label"])
    return sum(len(frames) for frames, key in zip(members, keys, strict=True) if context.store.lacks(MODEL, [key]))


def _pack(model: PlaceModel) -> Arrays:
    held_out = (model.mu, model.sigma) if model.mu is not None and model.sigma is not None else ()
    return {
        **{f"weights.{name}": value for name, value in model.weights.items()},
        "held_out": np.array(held_out, np.float64),
        "own": np.array([model.own_mu, model.own_sigma], np.float64),
        "epochs": np.array(model.epochs),
        "training": model.training,
        "validation": model.validation,
    }


def _unpack(arrays: Arrays) -> PlaceModel:
    mu, sigma = arrays["held_out"].tolist() or (None, None)
    own_mu, own_sigma = arrays["own"].tolist()
    weights = {name.removeprefix("weights."): a for name, a in arrays.items() if name.startswith("weights.")}
    return PlaceModel(
        weights, mu, sigma, int(arrays["epochs"]), arrays["training"], arrays["validation"], own_mu, own_sigma
    )


def fit_places(context: Context) -> tuple[NDArray[np.int64], list[Key], tuple[PlaceModel, ...], tuple[int, int]]:
    """Train the AE of every place that is not stored yet.

    Returns:
        The place of every map image (int64 [M]); per place its model's address and the model, μ and σ filled in; and
        the AEs' input size (height, width) in pixels.
    """
    config, size = context.config, _input_size(context)
    label = place_labels(context)
    members, keys = _members(context, label)

    def fit(place: int) -> Arrays:
        images = prepare((read_image(frame.path) for frame in members[place]), size)
        return _pack(fit_place(images, config.ad, config.seed, config.device))

    models = [_unpack(arrays) for arrays in context.fetch(MODEL, keys, fit, "autoencoders")]
    return label, keys, fill_statistics(models), size


def _places_of(context: Context, label: NDArray[np.int64], query: int) -> list[int]:
    """Return the places of a query's hypotheses, of the best alone with ``ad.hypotheses: top1``."""
    hypotheses = context.hypotheses[query]
    used = hypotheses[:1] if context.config.ad.hypotheses == "top1" else hypotheses
    return sorted({int(label[m]) for m in used})


def _addresses(context: Context, label: NDArray[np.int64], keys: list[Key], models: Sequence[PlaceModel]) -> list[Key]:
    addresses = []
    for query, frame in enumerate(context.dataset.query):
        places = _places_of(context, label, query)
        used = [(keys[place], *map(float.hex, _statistics(models[place]))) for place in places]
        addresses.append(STAGE.key({}, [frame.digest, *(value for entry in used for value in entry)]))
    return addresses


def missing(context: Context) -> int:
    """Count the queries without a stored result; all of them where an AE is not trained yet."""
    if untrained(context):
        return len(context.dataset.query)
    label, keys, models, _ = fit_places(context)
    return context.store.lacks(STAGE, _addresses(context, label, keys, models))


def detect(context: Context) -> Detected:
    """Return the LoC of every query (§AD): z of the AE of its place, the largest in each cell.

    With ``ad.hypotheses: top1`` the place is that of the best hypothesis, with ``min`` the smallest z over the places
    of all Y counts. A query without hypothesis gets 0.
    """
    data, config = context.dataset, context.config
    label, keys, models, size = fit_places(context)

    def cells(query: int) -> Arrays:
        frame, places = data.query[query], _places_of(context, label, query)
        if not places:
            return {"cz": np.zeros(grid_shape(frame.height, frame.width), np.float32)}
        image = prepare([read_image(frame.path)], size)
        z = [_z(models[place], image, config.device) for place in places]
        return {"cz": error_to_cells(np.min(z, axis=0), frame.height, frame.width)}

    addresses = _addresses(context, label, keys, models)
    # In double precision, or the division would make equals of neighbours and c would change a ranking.
    loc = [a["cz"].astype(np.float64) / config.ad.c for a in context.fetch(STAGE, addresses, cells, "AD")]
    weights = sum(weight.nbytes for model in models for weight in model.weights.values())
    return Detected(loc, weights / len(data.map))


def _statistics(model: PlaceModel) -> tuple[float, float]:
    assert model.mu is not None  # filled in by fit_places
    assert model.sigma is not None
    return model.mu, model.sigma


def _z(model: PlaceModel, image: Tensor, device: str) -> NDArray[np.float32]:
    return z_score(reconstruction_error(model.weights, image, device)[0], *_statistics(model))
