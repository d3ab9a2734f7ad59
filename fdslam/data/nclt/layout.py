"""Where things lie in a folder with NCLT, in the layouts that people have after unpacking.

With DATE as 2012-01-22 and CAM as Cam5, the first of these that is there:

- images ``UTIME.tiff`` (UTIME in µs) in ``DATE/lb3/CAM`` under the root, under ``images/``, or under ``DATE_lb3/`` in
  either; the same with ``DATE_lb3/lb3/CAM``, for archives unpacked without their first folder;
- poses in ``ground_truth/groundtruth_DATE.csv``, ``groundtruth_DATE.csv`` or ``DATE/groundtruth_DATE.csv``;
- the table of the undistortion ``U2D_CAM_1616X1232.txt`` in the root, or in ``U2D_ALL_1616X1232/``, ``U2D/``,
  ``ladybug3_calib/``, ``ladybug3_calib/U2D_ALL_1616X1232/`` or ``calib/U2D/``;
- annotations in ``annotations/QUERY-DATE_MAP-DATE.json``.
"""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fdslam.config import Nclt
from fdslam.data.nclt.sessions import session_pairs
from fdslam.errors import InputError

_SESSION = ("{0}", "images/{0}", "{0}_lb3/{0}", "images/{0}_lb3/{0}", "{0}_lb3", "images/{0}_lb3")
_POSES = ("ground_truth", ".", "{0}", "images/{0}")
_TABLES = (".", "U2D_ALL_1616X1232", "U2D", "ladybug3_calib", "ladybug3_calib/U2D_ALL_1616X1232", "calib/U2D")
_IMAGE = re.compile(r"(\d{1,18})\.tiff?", re.IGNORECASE)  # 18 digits always fit into 64 bits
_TIFF = re.compile(r"[^.].*\.tiff?", re.IGNORECASE)


@dataclass(frozen=True)
class Session:
    """The images of one camera in one session, not yet opened."""

    date: str
    camera: str
    folder: Path
    utimes: NDArray[np.int64]  # [n] µs, ascending, none twice
    files: tuple[str, ...]  # [n] names in ``folder``
    repeated: int  # images left out because their time stamp was there already
    misnamed: int  # TIFF files left out because their name is no time stamp

    def name(self, position: int) -> str:
        """Return the name of an image, which no other image of NCLT has: as in the published archives."""
        return f"{self.date}/lb3/{self.camera}/{self.files[position]}"


def root_folder(settings: Nclt) -> Path:
    """Return the folder of the data set.

    Raises:
        InputError: it is not there.
    """
    root = Path(settings.root).expanduser()
    if not root.is_dir():
        raise InputError(
            f"dataset.root={settings.root}: no such folder; give the folder that holds the sessions of NCLT"
        )
    return root


def check_nclt(settings: Nclt) -> None:
    """Find in the first second what would otherwise be missed late.

    Raises:
        InputError: no root, a session, camera, pose file or table of undistortion that is not there.
    """
    root = root_folder(settings)
    dates = dict.fromkeys(date for pair in chosen_pairs(settings) for date in pair)
    for date in dates:
        image_folder(root, date, settings.camera)
        pose_file(root, date)
    if settings.undistort:
        table_file(root, settings.camera)
    annotation_folder(root, settings)


def chosen_pairs(settings: Nclt) -> tuple[tuple[str, str], ...]:
    """Return the (query, map) pairs of dates that the configuration names; raises InputError as ``session_pairs``."""
    return session_pairs(*settings.chosen, settings.sessions)


def _files(folder: Path, name: re.Pattern[str]) -> Iterator[str]:
    with os.scandir(folder) as entries:
        yield from (entry.name for entry in entries if name.fullmatch(entry.name) and entry.is_file())


def _fetch(root: Path, date: str) -> str:
    return f"fetch it with python -m fdslam.fetch nclt --session {date} --to {shlex.quote(str(root))}"


def image_folder(root: Path, date: str, camera: str) -> Path:
    """Return the folder that holds a camera's images of a session.

    Raises:
        InputError: no session, no such camera in it, no image, or images in two of the accepted places.
    """
    sessions = [root / place.format(date) / "lb3" for place in _SESSION]
    sessions = [folder for folder in sessions if folder.is_dir()]
    if not sessions:
        raise InputError(
            f"{root / date / 'lb3'}: no such session (nor in images/ or {date}_lb3/); {_fetch(root, date)}"
        )
    cameras = [folder / camera for folder in sessions if (folder / camera).is_dir()]
    if not cameras:
        there = sorted({p.name for folder in sessions for p in folder.iterdir() if re.fullmatch("Cam[0-5]", p.name)})
        choose = f"choose dataset.camera={there[0]} or " if there else ""
        raise InputError(f"{sessions[0] / camera}: no such camera; {choose}{_fetch(root, date)} --camera {camera}")
    filled = [folder for folder in cameras if next(_files(folder, _IMAGE), None) is not None]
    if not filled:
        raise InputError(f"{cameras[0]}: holds no image named UTIME.tiff; {_fetch(root, date)}")
    if len(filled) > 1:
        raise InputError(f"{filled[0]} and {filled[1]} both hold images of {date}; move one of them out of {root}")
    return filled[0]


def read_session(root: Path, date: str, camera: str) -> Session:
    """List the images of a session in the order of their time stamps; raises InputError as ``image_folder``."""
    folder = image_folder(root, date, camera)
    stamped: dict[int, str] = {}
    files = sorted(_files(folder, _TIFF))
    misnamed = 0
    for file in files:
        if match := _IMAGE.fullmatch(file):
            stamped.setdefault(int(match[1]), file)
        else:
            misnamed += 1
    utimes = sorted(stamped)
    names = tuple(stamped[utime] for utime in utimes)
    return Session(
        date, camera, folder, np.array(utimes, np.int64), names, len(files) - misnamed - len(names), misnamed
    )


def pose_file(root: Path, date: str) -> Path:
    """Return the ground truth poses of a session; raises InputError if they are not there."""
    name = f"groundtruth_{date}.csv"
    for place in _POSES:
        if (path := root / place.format(date) / name).is_file():
            return path
    raise InputError(
        f"{root / 'ground_truth' / name}: no such file (nor in {root} or {root / date}); {_fetch(root, date)}"
    )


def table_file(root: Path, camera: str) -> Path:
    """Return the table of a camera's undistortion; raises InputError if it is not there."""
    name = f"U2D_{camera}_1616X1232.txt"
    for place in _TABLES:
        if (path := root / place / name).is_file():
            return path
    to = shlex.quote(str(root))
    raise InputError(
        f"{root / name}: no such file; it comes in NCLT's ladybug3_calib/U2D_ALL_1616X1232.tar.gz: fetch it with "
        f"python -m fdslam.fetch nclt --undistortion --camera {camera} --to {to}, or run with dataset.undistort=false"
    )


def annotation_folder(root: Path, settings: Nclt) -> Path:
    """Return where annotations would lie; raises InputError if that was named and is not there."""
    folder = root / Path(settings.annotations).expanduser()
    if settings.annotations != type(settings)().annotations and not folder.is_dir():
        raise InputError(f"dataset.annotations={settings.annotations}: no such folder; give that of the COCO files")
    return folder
