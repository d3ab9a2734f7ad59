"""Early fusion trained like the shipped way, with fewer features or on fewer map images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.compact.prepared import Maps, Prepared
from fdslam.compact.training import boosted, made_up_rows, sure_cells, turns
from fdslam.compact.trees import Trees
from fdslam.config import Training
from fdslam.data.folder import DRIVE_GAP
from fdslam.types import Dataset

Rows = NDArray[np.float32]  # [cells, features] of an image


@dataclass(frozen=True)
class MadeUp:
    """The cells of map images in which changes were made up."""

    image: tuple[int, ...]  # map id of each
    rows: tuple[Rows, ...]  # of each
    label: tuple[NDArray[np.uint8], ...]  # [cells] of each: 1 changed, 0 not, ``NEITHER``


def made_up(ready: Prepared) -> MadeUp:
    """Return what early fusion is trained on."""
    context = ready.context
    images = [m for _, m in turns(len(context.dataset.map), context.config.early)]
    found = made_up_rows(context, ready.kept)
    return MadeUp(tuple(images), tuple(one["features"] for one in found), tuple(one["label"] for one in found))


def learned(rows: Sequence[Rows], label: Sequence[NDArray[np.uint8]], config: Training, seed: int) -> Trees:
    """Return trees trained as ``compact.training.fit`` does, on any features."""
    return boosted(*sure_cells(rows, label), config, seed)


def maps_of(trees: Trees, rows: Sequence[Rows], like: Maps) -> Maps:
    """Return the LoC of every query; ``like``: maps of the same queries."""
    return [trees.loc(one, (cells.shape[0], cells.shape[1])) for one, cells in zip(rows, like, strict=True)]


def drives(times: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the drive of every map image, 0, 1, …, by its place along the session's path: drives lie far apart."""
    _, drive = np.unique(np.floor(times / DRIVE_GAP + 0.5), return_inverse=True)
    return drive.astype(np.int64)


def drives_of_queries(data: Dataset, best: Sequence[NDArray[np.int64]]) -> NDArray[np.int64]:
    """Return the drive of every query: of its true place where it is known, or of its best hypothesis."""
    drive = drives(data.times)
    true = data.relevant or (np.zeros(0, np.int64),) * len(best)
    return np.array([drive[(one if len(one) else images)[0]] for one, images in zip(true, best, strict=True)])


def other_drive(ready: Prepared, made: MadeUp, rows: Sequence[Rows], like: Maps) -> Maps | None:
    """Return the LoC of every query by trees that saw map images of the other drives alone; None with one drive.

    The maps of the drives stand in one pool, although no learner saw both.
    """
    context = ready.context
    drive, mine = drives(context.dataset.times), drives_of_queries(context.dataset, context.hypotheses)
    if len(np.unique(drive)) < 2:
        return None
    maps: Maps = list(like)
    for one in np.unique(mine):
        which = [i for i, m in enumerate(made.image) if drive[m] != one]
        config = context.config
        trees = learned([made.rows[i] for i in which], [made.label[i] for i in which], config.early, config.seed)
        for q in np.flatnonzero(mine == one).tolist():
            maps[q] = trees.loc(rows[q], (like[q].shape[0], like[q].shape[1]))
    return maps
