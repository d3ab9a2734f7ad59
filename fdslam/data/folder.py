"""A data set as a folder: ``map/`` and ``query/`` images and, where known, the truth about them.

Layout (everything but the two image folders is optional):

- ``annotations.json`` (COCO), ``annotations.xml`` (CVAT), ``annotations/`` or JSON files in ``query/`` (LabelMe): boxes
  of what has changed, see ``fdslam.data.annotations``. A query without an annotation shows no change.
- ``map.csv``           map_file, drive, index along the path; optionally x, y (metres), heading (radians).
- ``pairs.csv``         query_file, drive, query_index; optionally map_file, x, y, heading.
- ``labels/NAME.png``   label image of ``query/NAME.*``: 8 bit, indices into ``fdslam.types.LABELS``.

Two images show the same place if their poses are near or, without poses, if they lie at most ``tolerance`` indices
apart on one drive.
"""

from __future__ import annotations

import csv
import logging
import math
from collections import Counter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fdslam import config
from fdslam.data.annotations import find_annotations, match_boxes, read_annotations
from fdslam.data.images import SUFFIXES, image_size, is_file
from fdslam.data.relevance import nearest_first, places_by_pose
from fdslam.errors import InputError
from fdslam.store import sha256_file
from fdslam.types import Dataset, Frame

log = logging.getLogger(__name__)
DRIVE_GAP = 1_000_000.0  # in Dataset.times: between drives, so that no k-means by time joins two of them
_LARGEST_NUMBER = 1e12  # of an index, in metres or radians: far beyond any map, and its square is still a number


def check_folder(settings: config.Folder) -> None:
    """Raise InputError if the folder is not there, or holds two kinds of annotations; no file is opened."""
    root = Path(settings.root).expanduser()
    if not root.is_dir():
        raise InputError(f"dataset.root={settings.root}: no such folder; give the folder that holds map/ and query/")
    find_annotations(root, settings.annotations)


def read_folder(root: str | Path, settings: config.Dataset, name: str | None = None) -> Dataset:
    """Read the data set in folder ``root``; images are measured and hashed, not decoded.

    Raises:
        InputError: a missing folder, an image that a CSV or the annotations name and that is not there, sizes that
            disagree, a number that is none, a box outside its image.
    """
    base = Path(root).expanduser()
    if not base.is_dir():
        raise InputError(f"dataset.root={root}: no such folder; give the folder that holds map/ and query/")
    map_rows, pair_rows = (
        _rows(base / "map.csv", ("map_file", "drive", "index")),
        _rows(base / "pairs.csv", ("query_file", "drive", "query_index")),
    )
    maps = [_frame(base, file) for file in _files(base, "map", map_rows, "map_file")]
    queries = [_frame(base, file) for file in _files(base, "query", pair_rows, "query_file")]
    poses = _poses(base / "map.csv", map_rows)
    return Dataset(
        name=name or base.resolve().name,
        map=tuple(maps),
        query=tuple(queries),
        boxes=_boxes(base, queries, settings),
        relevant=_relevant(base, map_rows, pair_rows, settings),
        labels=_labels(base, queries),
        poses=poses,
        times=_times(base / "map.csv", map_rows, len(maps)),
    )


def _rows(path: Path, required: tuple[str, ...]) -> list[dict[str, str]] | None:
    if not path.is_file():
        return None
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read as a CSV file in UTF-8 ({error})") from error
    if not rows:
        raise InputError(f"{path}: holds no row; remove the file or list the images in it")
    missing = [column for column in required if column not in rows[0]]
    if missing:
        raise InputError(f"{path}: lacks the column {', '.join(missing)}; it has {', '.join(map(str, rows[0]))}")
    return rows


def _number(path: Path, line: int, row: dict[str, str], column: str) -> float:
    try:
        value = float(row[column])
    except (TypeError, ValueError):
        value = math.nan
    if not abs(value) <= _LARGEST_NUMBER:
        raise InputError(f"{path}, line {line}: {column} is {row[column]!r}, a number is needed")
    return value


def _column(path: Path, rows: list[dict[str, str]], column: str) -> NDArray[np.float64]:
    return np.array([_number(path, line, row, column) for line, row in enumerate(rows, 2)])


def _files(base: Path, folder: str, rows: list[dict[str, str]] | None, column: str) -> list[str]:
    if rows is not None:
        files = [_with_folder(base, folder, row[column] or "") for row in rows]
        twice = [file for file, count in Counter(files).items() if count > 1]
        if twice:
            raise InputError(f"{base / folder}.csv or pairs.csv lists {twice[0]} twice; each image is listed once")
        present = sum(p.suffix.lower() in SUFFIXES for p in (base / folder).glob("*"))
        if present > len(files):
            log.warning("%s: %d of %d images are not listed and left out", base / folder, present - len(files), present)
        return files
    if not (base / folder).is_dir():
        raise InputError(f"{base / folder}: no such folder; a data set has its images in map/ and query/")
    found = sorted(p.relative_to(base).as_posix() for p in (base / folder).iterdir() if p.suffix.lower() in SUFFIXES)
    known = (*SUFFIXES, ".json")  # LabelMe puts its files beside the images
    others = sorted(p.name for p in (base / folder).iterdir() if p.suffix.lower() not in known)
    if others and found:
        log.warning("%s: %d left out, no images by their suffix: %s …", base / folder, len(others), others[0])
    if not found:
        raise InputError(f"{base / folder}: holds no image ({', '.join(SUFFIXES)})")
    return found


def _with_folder(base: Path, folder: str, file: str) -> str:
    """Names may be given with the folder, as in ``query/a.jpg``, or without."""
    return f"{folder}/{file}" if not is_file(base / file) and is_file(base / folder / file) else file


def _frame(base: Path, file: str) -> Frame:
    path = base / file
    if not file or not is_file(path):
        shown = file if len(file) < 200 else f"{file[:200]}…"
        raise InputError(f"{str(base / shown)!r}: listed but not there; restore the image or take it out of the CSV")
    height, width = image_size(path)
    return Frame(file, path, sha256_file(path), height, width)


def _boxes(base: Path, queries: list[Frame], settings: config.Dataset) -> tuple[NDArray[np.float32], ...] | None:
    path = find_annotations(base, getattr(settings, "annotations", ""))
    if path is None:
        return None
    complete = path.is_file()  # LabelMe writes no file for an image without a shape
    classes = getattr(settings, "classes", ())
    return match_boxes(read_annotations(path), queries, (base, base / "query"), classes, complete)


def _poses(path: Path, rows: list[dict[str, str]] | None) -> NDArray[np.float64] | None:
    if rows is None or not all(column in rows[0] for column in ("x", "y", "heading")):
        return None
    return np.stack([_column(path, rows, column) for column in ("x", "y", "heading")], axis=1)


def _times(path: Path, rows: list[dict[str, str]] | None, count: int) -> NDArray[np.float64]:
    if rows is None:
        return np.arange(count, dtype=np.float64)
    drives = {drive: i for i, drive in enumerate(dict.fromkeys(row["drive"] for row in rows))}
    return _column(path, rows, "index") + DRIVE_GAP * np.array([drives[row["drive"]] for row in rows])


def _relevant(
    base: Path,
    map_rows: list[dict[str, str]] | None,
    pair_rows: list[dict[str, str]] | None,
    settings: config.Dataset,
) -> tuple[NDArray[np.int64], ...] | None:
    if map_rows is None or pair_rows is None:
        return None
    map_poses, query_poses = _poses(base / "map.csv", map_rows), _poses(base / "pairs.csv", pair_rows)
    if map_poses is not None and query_poses is not None:
        return places_by_pose(query_poses, map_poses, settings.radius, settings.angle)
    map_index = _column(base / "map.csv", map_rows, "index")
    query_index = _column(base / "pairs.csv", pair_rows, "query_index")
    same = np.array([[m["drive"] == q["drive"] for m in map_rows] for q in pair_rows])
    distance = np.abs(query_index[:, None] - map_index[None])
    near = same & (distance <= settings.tolerance)
    return tuple(nearest_first(n, d) for n, d in zip(near, distance, strict=True))


def _labels(base: Path, queries: list[Frame]) -> tuple[Path | None, ...] | None:
    """The label image of ``query/a/b.jpg`` is ``labels/a/b.png``."""
    names = [Path(frame.name) for frame in queries]
    paths = [base / "labels" / Path(*name.parts[1:] or name.parts).with_suffix(".png") for name in names]
    return tuple(p if p.is_file() else None for p in paths) if any(p.is_file() for p in paths) else None
