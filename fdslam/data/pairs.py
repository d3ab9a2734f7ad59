"""A data set of aligned image pairs with masks: one image of each pair is in the map, the other is a query.

Two images show the same place if they are of one pair or, where the pairs of a set follow each other along a path, of
pairs at most ``tolerance`` apart. The boxes of a query are those of the connected areas of its mask.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fdslam import config
from fdslam.data.folder import DRIVE_GAP
from fdslam.data.images import SUFFIXES, image_size
from fdslam.data.layouts import Pair, find_pairs
from fdslam.data.masks import areas, read_mask
from fdslam.data.relevance import nearest_first
from fdslam.errors import InputError
from fdslam.progress import in_parallel, progress
from fdslam.store import sha256_file
from fdslam.types import Dataset, Frame

log = logging.getLogger(__name__)
_MOST_CHANGED = 0.5  # share of all pixels: beyond it, black and white have been taken for each other


def check_pairs(settings: config.Pairs) -> None:
    """Raise InputError if the folder is not there, or an image or a mask lacks its partner; no file is opened."""
    root = Path(settings.root).expanduser()
    if not root.is_dir():
        raise InputError(
            f"dataset.root={settings.root}: no such folder; give the folder that holds the pairs, as t0/, t1/ and mask/"
        )
    find_pairs(root, settings.layout)


def read_pairs(settings: config.Pairs, workers: int = 1) -> Dataset:
    """Read the pairs in folder ``settings.root``; images are measured and hashed, masks decoded, in parallel.

    Raises:
        InputError: no pairs, a missing image or mask, one that cannot be read or does not fit, or masks that call most
            of the set changed.
    """
    root = Path(settings.root).expanduser()
    layout, pairs = find_pairs(root, settings.layout)
    log.info("%s: %d pairs, layout %s", root, len(pairs), layout)
    if left_out := _left_out(pairs):
        log.warning("%s: %d images and masks are in no pair and left out", root, left_out)
    if settings.direction == "t1_to_t0" and any(pair.mask_t0 is None for pair in pairs):
        raise InputError(f"dataset.direction=t1_to_t0: {layout} has masks for t1 alone; choose direction=t0_to_t1")
    jobs = (partial(_read, i, pair, root, settings) for i, pair in enumerate(pairs))
    found = sorted(progress(in_parallel(jobs, workers), len(pairs), "pairs"), key=lambda one: one.position)
    changed = np.mean([one.changed for one in found])
    if settings.changed == "auto" and changed > _MOST_CHANGED:
        raise InputError(
            f"{root}: read as {layout}, {100 * changed:.0f} % of all pixels would have changed; if black means "
            "changed give dataset.changed=black, if it is really so dataset.changed=white"
        )
    places = _positions(pairs)
    return Dataset(
        name=root.resolve().name,
        map=tuple(one.map for one in found),
        query=tuple(one.query for one in found),
        boxes=tuple(one.boxes for one in found),
        relevant=_relevant(places, [pair.sequence is not None for pair in pairs], settings.tolerance),
        labels=None,
        poses=None,
        times=places,
    )


@dataclass(frozen=True)
class _Read:
    """One pair, read."""

    position: int  # in the set
    map: Frame
    query: Frame
    boxes: NDArray[np.float32]  # [n, 4] xyxy, pixels of the query
    changed: float  # share of the query's pixels


def _read(position: int, pair: Pair, root: Path, settings: config.Pairs) -> _Read:
    before, after, mask = pair.t0, pair.t1, pair.mask_t1
    if settings.direction == "t1_to_t0":
        before, after, mask = pair.t1, pair.t0, pair.mask_t0
    assert mask is not None  # by read_pairs
    known, query = _frame(root, before), _frame(root, after)
    changed = read_mask(mask, query, pair.reading if settings.changed == "auto" else settings.changed)
    return _Read(position, known, query, areas(changed, settings.min_area), float(changed.mean()))


def _left_out(pairs: list[Pair]) -> int:
    """Count the images that lie beside those of the pairs and are in none."""
    used = {path for pair in pairs for path in (pair.t0, pair.t1, pair.mask_t0, pair.mask_t1) if path is not None}
    folders = {path.parent for path in used}
    return sum(path.suffix.lower() in SUFFIXES for folder in folders for path in folder.iterdir()) - len(used)


def _frame(root: Path, path: Path) -> Frame:
    height, width = image_size(path)
    return Frame(path.relative_to(root).as_posix(), path, sha256_file(path), height, width)


def _positions(pairs: list[Pair]) -> NDArray[np.float64]:
    """Count along each sequence, with a gap between two of them; pairs without a sequence are one."""
    counts: dict[str | None, int] = {}
    gaps = {sequence: DRIVE_GAP * i for i, sequence in enumerate(dict.fromkeys(pair.sequence for pair in pairs))}
    positions = []
    for pair in pairs:
        counts[pair.sequence] = counts.get(pair.sequence, -1) + 1
        positions.append(gaps[pair.sequence] + counts[pair.sequence])
    return np.array(positions, np.float64)


def _relevant(positions: NDArray[np.float64], ordered: list[bool], tolerance: int) -> tuple[NDArray[np.int64], ...]:
    """Return for each pair the pairs of its place, nearest first: itself alone where the set is in no order."""
    distances = (np.abs(positions - position) for position in positions)
    reach = [tolerance if one else 0 for one in ordered]
    return tuple(nearest_first(distance <= most, distance) for distance, most in zip(distances, reach, strict=True))
