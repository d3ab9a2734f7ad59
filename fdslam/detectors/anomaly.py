"""Anomaly detection (AD): what the autoencoder of the place cannot reconstruct has changed (§AD).

The map images are partitioned into k places, each with its own autoencoder (AE). A query is shown to the AE of the
place it was localised in; z = (RE - μ) / (c σ) makes the AEs' errors comparable. c is shared by all AEs, so what is
stored is c z, and another c repeats nothing.
"""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from fdslam.autoencoder.network import prepare as tensor
from fdslam.autoencoder.scoring import error_to_cells, reconstruction_error, region_to_cells, z_score
from fdslam.context import Context, Detected
from fdslam.data.images import LIBRARIES, read_image
from fdslam.place_models import PlaceModels, trained_places, untrained
from fdslam.store import Arrays, Key, Stage
from fdslam.types import Cells, grid_shape

STAGE = Stage("ad", ("fdslam.detectors.anomaly",), ("torch", "kornia", *LIBRARIES))


def _places_of(context: Context, label: NDArray[np.int64], query: int) -> list[int]:
    """Return the places of a query's hypotheses, of the best alone with ``ad.hypotheses: top1``."""
    hypotheses = context.hypotheses[query]
    used = hypotheses[:1] if context.config.ad.hypotheses == "top1" else hypotheses
    return sorted({int(label[m]) for m in used})


def _addresses(context: Context, places: PlaceModels) -> list[Key]:
    settings, addresses = context.config.ad, []
    for query, frame in enumerate(context.dataset.query):
        inputs = [frame.digest]
        for place in _places_of(context, places.label, query):
            inputs += [places.keys[place], *map(float.hex, places.held_out[place][settings.error])]
        if settings.region == "obb":
            boxes = context.localizations[query].library.xyxy
            inputs.append(hashlib.sha256(np.ascontiguousarray(boxes).tobytes()).hexdigest())
        addresses.append(STAGE.key({"error": settings.error, "region": settings.region}, inputs))
    return addresses


def missing(context: Context) -> int:
    """Count the queries without a stored result; all of them where an AE is not trained yet."""
    if untrained(context):
        return len(context.dataset.query)
    return context.store.lacks(STAGE, _addresses(context, trained_places(context)))


def prepare(context: Context) -> None:
    """Train the AEs that are not trained yet, and read all of them."""
    _ = trained_places(context).models


def detect(context: Context) -> Detected:
    """Return the LoC of every query (§AD): z of the AE of its place, the largest in each cell.

    With ``ad.hypotheses: top1`` the place is that of the best hypothesis, with ``min`` the smallest z over the places
    of all Y counts. With ``ad.region: obb`` z is averaged over the OBBs. A query without hypothesis gets 0.
    """
    data, config = context.dataset, context.config
    found = trained_places(context)

    def cells(query: int) -> Arrays:
        frame, places = data.query[query], _places_of(context, found.label, query)
        if not places:
            return {"cz": np.zeros(grid_shape(frame.height, frame.width), np.float32)}
        image = tensor([read_image(frame.path)], found.size)
        each = [_z(context, found, place, query, image) for place in places]
        return {"cz": np.min(each, axis=0) if config.ad.region == "obb" else _pixels(context, each, query)}

    addresses = _addresses(context, found)
    # In double precision, or the division would make equals of neighbours and c would change a ranking.
    loc = [a["cz"].astype(np.float64) / config.ad.c for a in context.fetch(STAGE, addresses, cells, "AD")]
    return Detected(loc, found.nbytes / len(data.map))


def _pixels(context: Context, each: list[NDArray[np.float32]], query: int) -> Cells:
    frame = context.dataset.query[query]
    return error_to_cells(np.min(each, axis=0), frame.height, frame.width)


def _z(context: Context, found: PlaceModels, place: int, query: int, image: Tensor) -> NDArray[np.float32]:
    """Return a query's z under the AE of a place: at the AE's pixels, or on cells with ``ad.region: obb``."""
    settings, frame, model = context.config.ad, context.dataset.query[query], found.model(place)
    mu, sigma = model.held_out[settings.error]
    error = reconstruction_error(model.weights, image, context.config.device, settings.error)[0]
    z = z_score(error, mu, sigma)
    if settings.region == "pixel":
        return z
    boxes = context.localizations[query].library.xyxy
    return region_to_cells(z, boxes, frame.height, frame.width, outside=-mu / sigma)  # V_RE = 0, as FD does
