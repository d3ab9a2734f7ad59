"""MLflow on an SQLite file of its own: a run of it for every run, in one experiment for every name."""

from __future__ import annotations

import fcntl
import hashlib
import logging
import os
import re
import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from fdslam.trackers.record import Name, Record
from fdslam.trackers.tracker import TrackerError, check_folder

if TYPE_CHECKING:
    from mlflow.tracking import MlflowClient

METRICS, PARAMETERS = 1000, 100  # that MLflow takes at once
LONGEST_KEY, LONGEST_VALUE = 250, 6000
QUIET = {"MLFLOW_DISABLE_TELEMETRY": "true", "DO_NOT_TRACK": "true", "MLFLOW_LOGGING_LEVEL": "CRITICAL"}


def key(name: Name) -> str:
    """Return a name in the characters that MLflow takes, different names as different keys.

    ``+`` is written ``:``, ``@`` " at ", and whatever else it refuses ``_xHEX_``: FD+AD is ``FD:AD``, recall@5 is
    "recall at 5". A key that would be too long ends in the name's digest.
    """
    written = "/".join(map(_part, name))
    if len(written) <= LONGEST_KEY:
        return written
    return f"{written[: LONGEST_KEY - 17]}_{hashlib.sha256(written.encode()).hexdigest()[:16]}"


def _part(part: str) -> str:
    # A dot at the beginning would make a folder of it; what the escapes could be mistaken for is escaped as well.
    escaped = re.sub(r"[^\w.\- +@]|^\.|_(?=x)| (?=at[ @])", lambda c: f"_x{ord(c[0]):x}_", part)
    return escaped.replace("+", ":").replace("@", " at ") or "_x_"


class MLflow:
    """Keeps ``mlflow.db`` and, beside it, the files of the runs in ``mlflow_files``.

    Figures and losses are metrics, the latter over epochs or folds; the configuration is parameters, pictures and files
    are artefacts.
    """

    needs: ClassVar[dict[str, str]] = {"mlflow": "mlflow-skinny", "sqlalchemy": "sqlalchemy", "alembic": "alembic"}

    def __init__(self, folder: Path) -> None:
        self.folder = folder.expanduser().resolve()
        self.database = self.folder / "mlflow.db"

    def check(self) -> None:
        """Raise OSError or TrackerError if the database cannot be written."""
        if odd := set(str(self.folder)) & set("?#%"):
            raise TrackerError(f"MLflow cannot open a database in a folder with {' '.join(sorted(odd))} in its name")
        check_folder(self.folder)
        try:  # MLflow itself would try for minutes
            database = sqlite3.connect(self.database, isolation_level=None)
            try:
                database.execute("BEGIN IMMEDIATE")
                database.execute("ROLLBACK")
            finally:
                database.close()
        except sqlite3.Error as error:
            raise TrackerError(f"{self.database.name}: {error}") from error

    def note(self, record: Record) -> str:
        """Write a run into the database, and say where it is."""
        with _alone(self.folder / "mlflow.lock"):
            self.check()
            _prepare()
            from mlflow.exceptions import MlflowException
            from mlflow.tracking import MlflowClient
            from sqlalchemy.exc import SQLAlchemyError

            try:
                client = MlflowClient(f"sqlite:///{self.database}")  # makes the tables where there are none
                return f"{self.database}, run {self._write(client, record)}"
            except (MlflowException, SQLAlchemyError) as error:
                raise TrackerError(str(error)) from error

    def _write(self, client: MlflowClient, record: Record) -> str:
        experiment = client.get_experiment_by_name(record.name)
        if experiment is None:
            files = (self.folder / "mlflow_files").as_uri()
            number = client.create_experiment(record.name, artifact_location=files)
        else:
            number = experiment.experiment_id
        there = client.search_runs(
            [number], f"tags.fdslam_run = '{record.identity}' and attributes.status = 'FINISHED'", max_results=1
        )
        if there:
            return there[0].info.run_id
        run = client.create_run(number, run_name=record.label, tags={"fdslam_run": record.identity}).info.run_id
        try:
            _fill(client, run, record)
        except BaseException:
            with suppress(Exception):  # of what failed already; the first error is the one to tell
                client.set_terminated(run, "FAILED")
            raise
        client.set_terminated(run)  # last: it says that all is there
        return run


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Let the jobs of a sweep in one after another: SQLite has but one writer, and the first makes the tables."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _prepare() -> None:
    """Import MLflow so that it tells neither its makers of every use nor the user what an error says anyway."""
    os.environ.update(QUIET)  # before the import, which would start what does
    import mlflow  # noqa: F401

    for name in ("mlflow", "alembic"):
        logging.getLogger(name).setLevel(logging.CRITICAL)


def _fill(client: MlflowClient, run: str, record: Record) -> None:
    from mlflow.entities import Metric, Param

    now = int(time.time() * 1000)
    metrics = [Metric(key(name), value, now, 0) for name, value in record.figures.items()]
    metrics += [Metric(key(name), v, now, step) for name, points in record.curves.items() for step, v in points]
    parameters = [Param(key((name,)), text[:LONGEST_VALUE]) for name, text in record.parameters.items()]
    for start in range(0, len(metrics), METRICS):
        client.log_batch(run, metrics=metrics[start : start + METRICS])
    for start in range(0, len(parameters), PARAMETERS):
        client.log_batch(run, params=parameters[start : start + PARAMETERS])
    for path in record.files:
        client.log_artifact(run, str(path))
    for path in record.pictures:
        client.log_artifact(run, str(path), "pictures")
