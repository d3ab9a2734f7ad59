"""Sky and ground are of no interest: their cells are reset (§Performance)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fdslam.config import Mask
from fdslam.data.images import read_labels
from fdslam.errors import InputError
from fdslam.types import CELL, LABELS, Dataset, grid_shape

UNINTERESTING = (LABELS.index("sky"), LABELS.index("ground"))


def masked_cells(labels: NDArray[np.uint8], min_share: float) -> NDArray[np.bool_]:
    """Tell which cells are sky or ground.

    Args:
        labels: uint8 [H, W], indices into ``LABELS``.
        min_share: a cell is masked where at least this share of its pixels is sky or ground. The paper resets pixels
            and a cell takes the maximum of its pixels: that is a share of 1.

    Returns:
        bool [rows, columns].
    """
    rows, columns = grid_shape(*labels.shape)
    dull = np.isin(labels, UNINTERESTING).astype(np.int64)
    starts = np.arange(rows) * CELL, np.arange(columns) * CELL
    count = np.add.reduceat(np.add.reduceat(dull, starts[0], axis=0), starts[1], axis=1)
    size = np.outer(np.diff([*starts[0], labels.shape[0]]), np.diff([*starts[1], labels.shape[1]]))
    return count >= np.maximum(min_share * size, 1)


def load_masks(dataset: Dataset, config: Mask) -> list[NDArray[np.bool_]] | None:
    """Return per query which cells are masked, or None for no mask.

    Raises:
        InputError: ``mask=labels`` and a query has no label image, or one that does not fit.
    """
    if config.source == "none":
        return None
    masks = []
    for i, frame in enumerate(dataset.query):
        path = dataset.labels[i] if dataset.labels is not None else None
        if path is None:
            raise InputError(
                f"mask=labels: {dataset.name} has no label image for {frame.name}; "
                "add labels/NAME.png for every query or run with mask=none"
            )
        masks.append(masked_cells(read_labels(path, frame.height, frame.width, len(LABELS)), config.min_share))
    return masks


def apply_masks(
    loc: Sequence[NDArray[np.floating]], masks: Sequence[NDArray[np.bool_]] | None
) -> list[NDArray[np.floating]]:
    """Reset the masked cells of every query to 0, or to the lowest LoC of all where a detector goes below 0."""
    if masks is None:
        return list(loc)
    floor = min(0.0, *(float(cells.min()) for cells in loc))
    return [np.where(mask, cells.dtype.type(floor), cells) for cells, mask in zip(loc, masks, strict=True)]
