"""Trackers: a plain dict from the configuration's name to what notes finished runs down, so that they can be compared.

They read what lies in a run's folder, after all of it was written: whatever happens to a tracker, no result is lost.
None talks to the network.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from fdslam.config import Tracker
from fdslam.errors import InputError
from fdslam.progress import say
from fdslam.trackers.mlflow import MLflow
from fdslam.trackers.record import read_record
from fdslam.trackers.tensorboard import TensorBoard
from fdslam.trackers.tracker import Notes, TrackerError

TRACKERS: dict[str, type[Notes]] = {"tensorboard": TensorBoard, "mlflow": MLflow}


def _absent(module: str) -> bool:
    found = find_spec(module)
    return found is None or found.origin is None  # or a folder of that name beside the command


def check_tracker(settings: Tracker) -> None:
    """Find in the first second what would keep the run from being noted down.

    Raises:
        InputError: a package is missing, or the folder cannot be written.
    """
    if settings.kind == "none":
        return
    tracker = TRACKERS[settings.kind]
    if missing := [package for module, package in tracker.needs.items() if _absent(module)]:
        raise InputError(
            f"tracker={settings.kind}: needs {', '.join(missing)}; pip install 'fdslam[{settings.kind}]' "
            "or run with tracker=none"
        )
    try:
        tracker(Path(settings.folder)).check()
    except (OSError, TrackerError) as error:
        raise InputError(f"{_failed(settings, error)}; choose another with tracker.folder=DIR") from error


def track(settings: Tracker, folder: Path, label: str) -> None:
    """Note down the finished run in a folder, unless it is there already.

    Args:
        settings: which tracker, and where.
        folder: of the run.
        label: of the run.

    Raises:
        InputError: it could not be done; what the run has found stands in its folder.
    """
    if settings.kind == "none":
        return
    try:
        where = TRACKERS[settings.kind](Path(settings.folder)).note(read_record(folder, label))
    except (OSError, TrackerError) as error:
        raise InputError(
            f"{_failed(settings, error)}; the run is whole in {folder} and not noted down, run it again for that"
        ) from error
    say(f"noted down in {where}")


def _failed(settings: Tracker, error: Exception) -> str:
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    name = (error.filename2 or error.filename) if isinstance(error, OSError) else None  # where to, of a copy
    at = f"{name}: " if name else ""
    return f"tracker={settings.kind}: cannot write to {settings.folder} ({at}{' '.join(reason.split())[:300]})"
