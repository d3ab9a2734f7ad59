"""What holds for every tracker: nothing is lost by it, and what it lacks is one line in the first second."""

import csv
import json
import resource
import shutil
import sys

import pytest

from fdslam import run
from fdslam.config import Config, Tracker
from fdslam.errors import InputError
from fdslam.finished import finished, signature
from fdslam.sweep import ERROR
from fdslam.trackers import TRACKERS, check_tracker, track

KINDS = sorted(TRACKERS)


def test_a_sweep_over_trackers_is_one_run_noted_down_twice(swept):
    assert swept.status == 0, swept.said
    assert swept.said.count("finished before, in ") == 1
    told = [line for line in swept.said.splitlines() if line.startswith("noted down in ")]
    assert len(told) == 2
    assert "tensorboard" in told[0]
    assert "mlflow.db" in told[1]
    assert swept.read(0, "table.json") == swept.read(1, "table.json")
    with (swept.sweep / "sweep.csv").open() as file:
        columns = next(csv.reader(file))
    assert columns[:4] == ["job", "dataset", "pair", "method"]  # the tracker is no key that jobs are compared by


def test_nobody_is_asked_and_nothing_but_our_own_lines_is_said(swept):
    assert (swept.base / "asked.txt").read_text() == ""
    for word in ("mlflow.", "alembic", "INFO", "tensorflow", "git"):
        assert word not in swept.said.replace(str(swept.tracking / "mlflow.db"), "")


def test_the_tracker_is_no_part_of_a_result(tmp_path):
    wanted = signature(Config(), {})
    (tmp_path / "run.json").write_text(json.dumps(wanted))
    assert finished(signature(Config(tracker=Tracker("mlflow", "elsewhere")), {}), [tmp_path]) == tmp_path


@pytest.mark.parametrize(
    ("kind", "module", "named"),
    [
        ("tensorboard", "tensorboard", "tensorboard"),
        ("mlflow", "mlflow", "mlflow-skinny"),
        ("mlflow", "sqlalchemy", "sqlalchemy"),
        ("mlflow", "alembic", "alembic"),
    ],
)
def test_a_missing_extra_is_one_line_before_anything_is_done(kind, module, named, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, module, None)  # so that neither find_spec nor import finds it
    config = Config(store=str(tmp_path / "store"), tracker=Tracker(kind, str(tmp_path / "tracking")))
    with pytest.raises(InputError) as told:
        run.check_surroundings(config)
    assert str(told.value) == (f"tracker={kind}: needs {named}; pip install 'fdslam[{kind}]' or run with tracker=none")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_of_that_name_is_not_taken_for_the_package(monkeypatch, tmp_path):
    (tmp_path / "tensorboard").mkdir()
    monkeypatch.delitem(sys.modules, "tensorboard", raising=False)
    monkeypatch.setattr(sys, "path", [str(tmp_path)])
    with pytest.raises(InputError, match="needs tensorboard"):
        check_tracker(Tracker("tensorboard", str(tmp_path / "tracking")))


@pytest.mark.parametrize("kind", KINDS)
def test_a_folder_that_cannot_be_written_is_told_at_the_start(kind, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=rf"^tracker={kind}: cannot write to .*file.*choose another with tracker\.f"):
        check_tracker(Tracker(kind, str(tmp_path / "file" / "x")))


def test_a_file_that_is_no_database_is_told_at_the_start(tmp_path):
    (tmp_path / "mlflow.db").write_text("something else, and long enough for SQLite to look at it" * 20)
    with pytest.raises(InputError, match=r"^tracker=mlflow: .*mlflow\.db: file is not a database"):
        check_tracker(Tracker("mlflow", str(tmp_path)))
    with pytest.raises(InputError, match="MLflow cannot open a database in a folder with # %"):
        check_tracker(Tracker("mlflow", str(tmp_path / "a%20#b")))


@pytest.fixture
def small_files():
    """No file may grow beyond 64 KiB, which is met like the end of a disk: a write fails after others went well."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (65_536, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture
def job(swept, tmp_path):
    """A job of a sweep of its own, with what is in the trackers already."""
    shutil.copytree(swept.tracking, tmp_path / "tracking")
    return shutil.copytree(swept.sweep / "0", tmp_path / "sweep" / "0")


@pytest.mark.parametrize("kind", KINDS)
def test_a_full_disk_is_one_line_and_the_run_is_kept(kind, job, tmp_path, small_files, capfd):
    config = Config(tracker=Tracker(kind, str(tmp_path / "tracking")))
    before = {path: path.read_bytes() for path in job.rglob("*") if path.is_file()}
    with pytest.raises(InputError, match=rf"^tracker={kind}: cannot write to .*; the run is whole in ") as told:
        run._track(config, job, sweep=False)
    assert "\n" not in str(told.value)
    assert capfd.readouterr().err == ""
    assert before == {path: path.read_bytes() for path in job.rglob("*") if path.is_file()}


def test_a_disk_that_is_full_before_the_tables_are_made(swept, tmp_path, small_files):
    with pytest.raises(InputError, match=r"^tracker=mlflow: cannot write to .*; the run is whole in "):
        track(Tracker("mlflow", str(tmp_path)), swept.sweep / "0", "x")


@pytest.mark.parametrize("kind", KINDS)
def test_a_job_that_was_not_noted_down_is_finished_and_says_so(kind, job, tmp_path, capsys):
    """Run again, the sweep finds it finished, and the tracker gets it then."""
    (tmp_path / "file").touch()
    run._track(Config(tracker=Tracker(kind, str(tmp_path / "file"))), job, sweep=True)
    assert (job / "run.json").is_file()
    assert (job / ERROR).read_text().startswith(f"tracker={kind}: ")
    assert capsys.readouterr().err == f"fdslam: {(job / ERROR).read_text()}"
    run._track(Config(tracker=Tracker(kind, str(tmp_path / "tracking"))), job, sweep=True)
    assert capsys.readouterr().err.startswith("noted down in ")


def test_none_reads_nothing(tmp_path):
    track(Tracker(), tmp_path / "nowhere", "x")
    assert list(tmp_path.iterdir()) == []
