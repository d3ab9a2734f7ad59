"""Sweeps: jobs that were finished before are not repeated, and what all of them found is gathered in one table."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hydra.experimental.callback import Callback
from omegaconf import DictConfig

from fdslam.errors import InputError
from fdslam.finished import finished
from fdslam.progress import say
from fdslam.store import write_atomically

ERROR = "error.txt"  # in the folder of a job that ended in one line
USAGE_ERROR = 2


def reused(folder: Path, name: str, wanted: dict[str, Any]) -> bool:
    """Put the results of a finished job into a job's folder, and tell whether there was one.

    It is looked for in the folder itself, in the sweep that it belongs to, and among the runs and sweeps of the same
    name beside that.

    Args:
        folder: of the job.
        name: of the runs.
        wanted: the signature of the job.
    """
    found = finished(wanted, _candidates(folder, name))
    if found is None:
        return False
    if found != folder:
        unfinish(folder)
        said = (found / "run.json").read_bytes()
        skip = shutil.ignore_patterns("run.json", ERROR)
        shutil.copytree(found, folder, dirs_exist_ok=True, ignore=skip)
        if finished(wanted, [found]) is None:  # another job began to write there
            return False
        write_atomically(folder / "run.json", said)  # last: it says that all is there
    (folder / ERROR).unlink(missing_ok=True)
    say(f"finished before, in {found}")
    return True


def _candidates(folder: Path, name: str) -> Iterator[Path]:
    yield folder
    yield from sorted(folder.parent.glob("*"))
    if (runs := folder.parent.parent).name == name:
        yield from sorted(runs.glob("*"), reverse=True)
        yield from sorted(runs.glob("*_sweep/*"), reverse=True)


class Collector(Callback):
    """Hydra's callback that writes the table and the figures of a sweep when its jobs are done."""

    def on_multirun_end(self, config: DictConfig, **kwargs: Any) -> None:
        """Write them; a sweep in which a job ended in an error ends with status 2."""
        from fdslam.report.sweep import write_sweep  # with matplotlib and pyarrow: not for runs that are no sweep

        folder = Path(config.hydra.sweep.dir)
        try:
            print(write_sweep(folder))
            print(f"\nwritten to {folder}")
        except InputError as error:  # Hydra would make a warning of it
            say(f"fdslam: {error}")
            sys.exit(USAGE_ERROR)
        failed = sorted(path.parent.name for path in folder.glob(f"*/{ERROR}"))
        if failed:
            say(f"fdslam: jobs {', '.join(failed)} of {folder} failed, each with the line in its {ERROR}; "
                "run again to do these alone")  # fmt: skip
            sys.exit(USAGE_ERROR)


def unfinish(folder: Path) -> None:
    """Take from a folder what says that it holds a finished run: another is about to be written there."""
    (folder / "run.json").unlink(missing_ok=True)


def note_failure(folder: Path, error: InputError) -> None:
    """Leave the line of a job's error in its folder, so that the other jobs of the sweep go on.

    Args:
        folder: of the job.
        error: that ended it.
    """
    unfinish(folder)
    note_untracked(folder, error)


def note_untracked(folder: Path, error: InputError) -> None:
    """Leave a line in the folder of a job whose results are whole, but which a tracker could not note down.

    The sweep run again finds the job finished, and gives it to the tracker alone.

    Args:
        folder: of the job.
        error: of the tracker.
    """
    write_atomically(folder / ERROR, f"{error}\n".encode())
