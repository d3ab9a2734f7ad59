"""One sweep of two jobs that differ in nothing but their tracker, watched for connections."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.data.worlds import small_world
from tests.test_run import QUICK, ROOT

# Every connection and every look-up of a host by any thread is an event of Python's own audit.
WATCHED = """
import runpy, sys
asked = open("asked.txt", "w")
def watch(event, given):
    if event in ("socket.connect", "socket.getaddrinfo", "socket.gethostbyname", "socket.sendto"):
        print(event, *map(str, given), file=asked, flush=True)
sys.addaudithook(watch)
runpy.run_module("fdslam.run", run_name="__main__", alter_sys=True)
"""
# MLflow tells nobody where these say that it is tested; a user has none of them.
TESTED = ("PYTEST_CURRENT_TEST", "CI", "GITHUB_ACTIONS", "MLFLOW_DISABLE_TELEMETRY", "DO_NOT_TRACK")


@dataclass(frozen=True)
class Swept:
    base: Path  # where the command ran
    sweep: Path  # folder of the jobs
    said: str  # on standard error
    status: int

    @property
    def tracking(self):
        return self.base / "outputs" / "tracking"

    def read(self, job, name):
        return json.loads((self.sweep / str(job) / name).read_text())


@pytest.fixture(scope="session")
def swept(tmp_path_factory):
    """Job 0 is noted down by TensorBoard; job 1, the same run for MLflow, finds it finished."""
    base = tmp_path_factory.mktemp("tracked")
    small_world(base / "world")
    arguments = [
        "-m", "+experiment=fd_ad", "tracker=tensorboard,mlflow", "obb=j_b", "dataset=folder", "dataset.root=world",
        *QUICK,
    ]  # fmt: skip
    surroundings = {key: value for key, value in os.environ.items() if key not in TESTED}
    surroundings["PYTHONPATH"] = str(ROOT)
    done = subprocess.run(
        [sys.executable, "-c", WATCHED, *arguments],
        cwd=base, env=surroundings, capture_output=True, text=True, check=False,
    )  # fmt: skip
    (sweep,) = (base / "outputs" / "fd_ad").glob("*_sweep")
    return Swept(base, sweep, done.stderr, done.returncode)
