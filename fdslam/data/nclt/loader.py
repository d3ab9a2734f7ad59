"""NCLT as data sets: one for each ordered pair of a query and a map session."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fdslam.config import Nclt
from fdslam.data.images import image_size
from fdslam.data.nclt.annotations import Annotated, boxes_of, read_annotated
from fdslam.data.nclt.layout import (
    Session,
    annotation_folder,
    chosen_pairs,
    pose_file,
    read_session,
    root_folder,
    table_file,
)
from fdslam.data.nclt.poses import MICROSECONDS, interpolate, read_track, sample
from fdslam.data.nclt.sessions import session_label
from fdslam.data.nclt.upright import count_missing, make_upright
from fdslam.data.outline import Outline
from fdslam.data.relevance import places_by_pose
from fdslam.errors import InputError
from fdslam.store import Store
from fdslam.types import Dataset, Frame

log = logging.getLogger(__name__)
NAME = "nclt"


@dataclass(frozen=True)
class _Posed:
    """A session whose images know where they were taken."""

    session: Session
    poses: NDArray[np.float64]  # [n, 3] x, y, heading of all images, NaN where unknown
    sampled: NDArray[np.int64]  # positions of the images that make a map, or the queries where none are annotated

    def seconds(self, positions: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return when images were taken, seconds since the first image of the session."""
        utimes = self.session.utimes
        return (utimes[positions] - utimes[0]) / MICROSECONDS


@dataclass(frozen=True)
class _Pair:
    """A query and a map session, and which of their images are used."""

    query: _Posed
    map: _Posed
    annotated: Annotated | None
    queries: NDArray[np.int64]  # positions in the query session, ascending


def load_nclt(settings: Nclt, store: Store, workers: int) -> tuple[Dataset, ...]:
    """Return the pairs of sessions that the configuration names; images are turned upright into the store.

    An image is turned and hashed once, however many pairs use it, and has the same frame in all of them.

    Raises:
        InputError: something is missing, damaged or does not fit together.
    """
    pairs = _pairs(settings)
    _say_what_is_left_out({one.session.date: one for pair in pairs for one in (pair.query, pair.map)}, settings)
    for pair in pairs:
        listed = len(pair.annotated.images) if pair.annotated else 0
        if pair.annotated and len(pair.queries) < listed:
            lost = listed - len(pair.queries)
            log.warning("%s: %d of %d queries have no pose and are left out", pair.annotated.path, lost, listed)
    frames = make_upright(_files(pairs), _table(settings), store, workers)
    return tuple(_dataset(pair, frames, settings) for pair in pairs)


def outline_nclt(settings: Nclt, store: Store) -> Outline:
    """Return how many images the pairs have, from lists and poses alone."""
    pairs = _pairs(settings)
    files = _files(pairs)
    height, width = image_size(next(iter(files.values())))
    maps = {pair.map.session.date: len(pair.map.sampled) for pair in pairs}
    return Outline(
        images=len(files),
        missing=count_missing(files, _table(settings), store),
        maps=tuple(maps.values()),
        pairs=tuple((len(pair.queries), len(pair.map.sampled)) for pair in pairs),
        height=width,  # they lie on their side
        width=height,
        annotated=any(pair.annotated for pair in pairs),
    )


def _table(settings: Nclt) -> Path | None:
    return table_file(root_folder(settings), settings.camera) if settings.undistort else None


def _pairs(settings: Nclt) -> list[_Pair]:
    root, dates = root_folder(settings), chosen_pairs(settings)
    posed = {date: _posed(settings, date) for date in dict.fromkeys(date for pair in dates for date in pair)}
    folder = annotation_folder(root, settings)
    return [_pair(posed[query], posed[map], read_annotated(folder, posed[query].session, map)) for query, map in dates]


def _files(pairs: Sequence[_Pair]) -> dict[str, Path]:
    """Return the raw image of every frame that a pair uses, by the frame's name."""
    used: dict[str, set[int]] = {}
    sessions = {one.session.date: one.session for pair in pairs for one in (pair.query, pair.map)}
    for pair in pairs:
        used.setdefault(pair.query.session.date, set()).update(pair.queries.tolist())
        used.setdefault(pair.map.session.date, set()).update(pair.map.sampled.tolist())
    return {
        sessions[date].name(i): sessions[date].folder / sessions[date].files[i]
        for date, positions in used.items()
        for i in sorted(positions)
    }


def _posed(settings: Nclt, date: str) -> _Posed:
    root = root_folder(settings)
    session = read_session(root, date, settings.camera)
    path = pose_file(root, date)
    poses = interpolate(read_track(path), session.utimes, settings.gap)
    known = np.flatnonzero(~np.isnan(poses[:, 0]))
    if not len(known):
        raise InputError(
            f"{path}: has a pose for none of the {len(poses)} images in {session.folder}; "
            f"the time stamps must be those of one session, and dataset.gap={settings.gap} may be too small"
        )
    return _Posed(session, poses, known[sample(session.utimes[known], poses[known], settings.every, settings.seconds)])


def _say_what_is_left_out(posed: Mapping[str, _Posed], settings: Nclt) -> None:
    """Count in one line the images that cannot be used; those that sampling leaves out are no surprise."""
    counts = []
    for date, one in posed.items():
        unknown, repeated, misnamed = int(np.isnan(one.poses[:, 0]).sum()), one.session.repeated, one.session.misnamed
        if unknown or repeated or misnamed:
            again = f", {repeated} with a time stamp that was there already" if repeated else ""
            others = f", {misnamed} not named UTIME.tiff" if misnamed else ""
            counts.append(f"{unknown} of {len(one.poses)} images of {date} without a pose{again}{others}")
    if counts:
        log.warning("left out: %s (poses up to %g s apart are bridged, dataset.gap)", "; ".join(counts), settings.gap)


def _pair(query: _Posed, map: _Posed, annotated: Annotated | None) -> _Pair:
    if annotated is None:
        return _Pair(query, map, None, query.sampled)
    listed = np.array(sorted(annotated.images), np.int64)
    known = listed[~np.isnan(query.poses[listed, 0])]
    if not len(known):
        raise InputError(f"{annotated.path}: none of its images has a pose; check the time stamps, or dataset.gap")
    return _Pair(query, map, annotated, known)


def _dataset(pair: _Pair, frames: Mapping[str, Frame], settings: Nclt) -> Dataset:
    query, map = pair.query.session, pair.map.session
    queries = {int(i): frames[query.name(i)] for i in pair.queries}
    poses = pair.map.poses[pair.map.sampled]
    return Dataset(
        name=NAME,
        map=tuple(frames[map.name(i)] for i in pair.map.sampled),
        query=tuple(queries.values()),
        boxes=boxes_of(pair.annotated, queries) if pair.annotated else None,
        relevant=places_by_pose(pair.query.poses[pair.queries], poses, settings.radius, settings.angle),
        labels=None,
        poses=poses,
        times=pair.map.seconds(pair.map.sampled),
        pair=(session_label(query.date), session_label(map.date)),
    )
