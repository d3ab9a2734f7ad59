"""What the trackers have in common."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import ClassVar, Protocol

from fdslam.trackers.record import Record


class TrackerError(Exception):
    """What a tracker's own libraries complain of."""


class Notes(Protocol):
    """Keeps notes of finished runs in a folder."""

    needs: ClassVar[dict[str, str]]  # modules, and the packages that have them

    def __init__(self, folder: Path) -> None: ...

    def check(self) -> None:
        """Raise OSError or TrackerError if nothing can be noted down in the folder."""
        ...

    def note(self, record: Record) -> str:
        """Note a run down, unless it is there already, and say where; raises OSError or TrackerError."""
        ...


def check_folder(folder: Path) -> None:
    """Make the folder if it is not there; raises OSError if a file in it cannot be made."""
    os.makedirs(folder, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder):
        pass
