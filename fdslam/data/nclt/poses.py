"""Ground truth poses of a session, and the pose of a camera image between two of them.

A file has one line a pose, ``utime,x,y,z,roll,pitch,heading``, no header; µs, metres and radians. Lines with NaN say
that the robot was not localised. Only x, y and heading are used.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fdslam.errors import InputError

MICROSECONDS = 1_000_000  # in a second
_COLUMNS = (0, 1, 2, 6)  # utime, x, y, heading
_LATEST = 2**53  # µs: up to here a float64 holds every stamp exactly


@dataclass(frozen=True)
class Track:
    """Where the robot was."""

    utimes: NDArray[np.int64]  # [n] µs, ascending, none twice; n >= 1
    poses: NDArray[np.float64]  # [n, 3] x, y in metres, heading in radians


def read_track(path: Path) -> Track:
    """Read a pose file; lines with NaN are dropped, and of lines with one time stamp the first is kept.

    Raises:
        InputError: text among the numbers, too few columns, a time stamp that is none, no pose at all.
    """
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "loadtxt: input contained no data")  # said below, with the file's name
            rows = np.loadtxt(path, delimiter=",", usecols=_COLUMNS, ndmin=2, comments=None, encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        raise InputError(
            f"{path}{_first_bad_line(path)}: utime,x,y,z,roll,pitch,heading in numbers are needed"
        ) from error
    rows = rows[np.isfinite(rows).all(axis=1)]
    if not len(rows):
        raise InputError(f"{path}: holds no pose; download it again")
    bad = (rows[:, 0] < 0) | (rows[:, 0] >= _LATEST) | (rows[:, 0] % 1 != 0)
    if bad.any():
        raise InputError(f"{path}: {rows[bad][0, 0]!r} is no time stamp in whole microseconds; download it again")
    utimes, first = np.unique(rows[:, 0].astype(np.int64), return_index=True)
    return Track(utimes, rows[first, 1:])


def _first_bad_line(path: Path) -> str:
    """Say which line cannot be read: numpy counts otherwise, and skips empty lines."""
    try:
        with path.open(encoding="utf-8-sig") as file:
            for number, line in enumerate(file, 1):
                cells = line.split(",")
                if line.strip() and not (len(cells) > max(_COLUMNS) and all(_is_number(cells[c]) for c in _COLUMNS)):
                    return f", line {number}"
    except (OSError, UnicodeDecodeError):
        pass  # then the whole file is at fault
    return ""


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def wrap(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return angles on the circle, in (-π, π]."""
    return math.pi - (math.pi - angle) % (2 * math.pi)


def interpolate(track: Track, utimes: NDArray[np.int64], gap: float) -> NDArray[np.float64]:
    """Return the pose at each time stamp: x, y on the line between the two poses around it, heading on the shorter arc.

    Args:
        track: the poses.
        utimes: int64 [n], µs.
        gap: seconds; between two poses further apart nothing is known, nor before the first or after the last.

    Returns:
        float64 [n, 3] x, y in metres and heading in (-π, π]; NaN where nothing is known.
    """
    after = np.searchsorted(track.utimes, utimes)  # the first pose at or after
    inside = after < len(track.utimes)
    after = np.where(inside, after, 0)
    exact = inside & (track.utimes[after] == utimes)
    before = np.where(exact, after, np.maximum(after - 1, 0))
    span = track.utimes[after] - track.utimes[before]
    known = exact | (inside & (after > 0) & (span <= round(gap * MICROSECONDS)))
    share = np.where(span > 0, (utimes - track.utimes[before]) / np.maximum(span, 1), 0.0)
    start, step = track.poses[before], track.poses[after] - track.poses[before]
    step[:, 2] = wrap(step[:, 2])
    poses = start + share[:, None] * step
    poses[:, 2] = wrap(poses[:, 2])
    return np.where(known[:, None], poses, np.nan)


def sample(utimes: NDArray[np.int64], poses: NDArray[np.float64], every: float, seconds: float) -> NDArray[np.int64]:
    """Return which images are kept: the first, and each far enough from the last one kept, in space and in time.

    The distance is as the crow flies, so that a robot that stands still, or whose pose trembles, gives no image.

    Args:
        utimes: int64 [n], µs, ascending.
        poses: float64 [n, 3] x, y, heading.
        every: metres.
        seconds: between images.

    Returns:
        int64 [k], ascending positions.
    """
    kept: list[int] = []
    least = round(seconds * MICROSECONDS)
    for i, (utime, (x, y, _)) in enumerate(zip(utimes.tolist(), poses.tolist(), strict=True)):
        if kept:
            last = kept[-1]
            far = math.hypot(x - poses[last, 0], y - poses[last, 1]) >= every
            if not (far and utime - int(utimes[last]) >= least):
                continue
        kept.append(i)
    return np.array(kept, np.int64)
