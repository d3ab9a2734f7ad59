"""Sky and ground are of no interest: their cells are reset (§Performance)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.config import Mask
from fdslam.context import ensure, load
from fdslam.data.images import LIBRARIES, read_image, read_labels
from fdslam.errors import InputError
from fdslam.store import Arrays, Stage, Store
from fdslam.types import CELL, LABELS, Dataset, Frame, grid_shape

if TYPE_CHECKING:
    from fdslam.segmentation import Segmentation

UNINTERESTING = (LABELS.index("sky"), LABELS.index("ground"))
_DULL = np.isin(np.arange(256), UNINTERESTING).astype(np.uint8)
STAGE = Stage("mask", ("fdslam.mask", "fdslam.segmentation"), LIBRARIES)


def segmentation(config: Mask, device: str) -> Segmentation | None:
    """Return the model that tells sky and ground, made once for a run; None where the mask needs none.

    Raises:
        InputError: a model that is missing, damaged or not understood.
    """
    if config.source != "deeplabv3plus":
        return None
    from fdslam.segmentation import Segmentation  # onnxruntime takes a while to import

    return Segmentation(config, device)


def dull_pixels(labels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return how many pixels of every cell are sky or ground: uint8 [rows, columns], at most 100.

    Args:
        labels: uint8 [H, W], indices into ``LABELS``.
    """
    (height, width), (rows, columns) = labels.shape, grid_shape(*labels.shape)
    whole = np.zeros((rows * CELL, columns * CELL), np.uint8)  # cells at the border are filled up with nothing
    whole[:height, :width] = cv2.LUT(labels, _DULL)
    # Rows first: they are added a register at a time, and what is left for the columns is a tenth.
    strips = whole.reshape(rows, CELL, -1).sum(axis=1, dtype=np.uint8)
    return strips.reshape(rows, columns, CELL).sum(axis=2, dtype=np.uint8)


def masked_cells(dull: NDArray[np.uint8], height: int, width: int, min_share: float) -> NDArray[np.bool_]:
    """Tell which cells are reset.

    Args:
        dull: uint8 [rows, columns], pixels of sky or ground.
        height: of the image, pixels.
        width: of the image, pixels.
        min_share: a cell is masked where at least this share of its pixels is sky or ground. The paper resets pixels
            and a cell takes the maximum of its pixels: that is a share of 1.

    Returns:
        bool [rows, columns].
    """
    starts = (np.arange(count) * CELL for count in dull.shape)
    sides = [np.diff([*start, side]) for start, side in zip(starts, (height, width), strict=True)]
    return dull >= np.maximum(min_share * np.outer(*sides), 1)


def _dull(model: Segmentation, frame: Frame) -> Arrays:
    return {"dull": dull_pixels(model.labels(read_image(frame.path)))}


def missing_masks(dataset: Dataset, model: Segmentation | None, store: Store) -> int:
    """Count the queries that the model has still to look at."""
    if model is None:
        return 0
    return store.lacks(STAGE, (STAGE.key(model.identity, [frame.digest]) for frame in dataset.query))


def load_masks(
    dataset: Dataset, config: Mask, model: Segmentation | None, store: Store, workers: int
) -> list[NDArray[np.bool_]] | None:
    """Return per query which cells are masked, or None for no mask.

    Args:
        dataset: of which the queries are masked.
        config: the switches.
        model: as ``segmentation`` returns it.
        store: keeps what the model says.
        workers: that look at images in parallel.

    Raises:
        InputError: ``mask=labels`` and a query has no label image, or one that does not fit.
    """
    if config.source == "none":
        return None
    if model is not None:
        keys = [STAGE.key(model.identity, [frame.digest]) for frame in dataset.query]
        jobs = {key: partial(_dull, model, frame) for key, frame in zip(keys, dataset.query, strict=True)}
        ensure(store, STAGE, jobs, workers, "masks")
        counts = [load(store, STAGE, key, jobs[key])["dull"] for key in keys]
        return [
            masked_cells(dull, frame.height, frame.width, config.min_share)
            for dull, frame in zip(counts, dataset.query, strict=True)
        ]
    masks = []
    for i, frame in enumerate(dataset.query):
        path = dataset.labels[i] if dataset.labels is not None else None
        if path is None:
            raise InputError(
                f"mask=labels: {dataset.name} has no label image for {frame.name}; "
                "add labels/NAME.png for every query or run with mask=none"
            )
        dull = dull_pixels(read_labels(path, frame.height, frame.width, len(LABELS)))
        masks.append(masked_cells(dull, frame.height, frame.width, config.min_share))
    return masks


def apply_masks(
    loc: Sequence[NDArray[np.floating]], masks: Sequence[NDArray[np.bool_]] | None
) -> list[NDArray[np.floating]]:
    """Reset the masked cells of every query to 0, or to the lowest LoC of all where a detector goes below 0."""
    if masks is None:
        return list(loc)
    floor = min(0.0, *(float(cells.min()) for cells in loc))
    return [np.where(mask, cells.dtype.type(floor), cells) for cells, mask in zip(loc, masks, strict=True)]
