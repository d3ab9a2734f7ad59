"""What MLflow's own client finds in the database, against the run's table.json and files."""

import shutil
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote, urlparse

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mlflow.tracking import MlflowClient
from mlflow.utils.validation import _validate_metric_name

from fdslam.config import Tracker
from fdslam.errors import InputError
from fdslam.trackers import mlflow, track
from fdslam.trackers.mlflow import MLflow, key
from fdslam.trackers.record import read_record
from tests.trackers.test_record import stored_losses, told


def client_of(folder):
    return MlflowClient(f"sqlite:///{folder / 'mlflow.db'}")


def runs_of(client, name="fd_ad"):
    return client.search_runs([client.get_experiment_by_name(name).experiment_id])


@pytest.fixture(scope="module")
def client(swept):
    return client_of(swept.tracking)


@pytest.fixture(scope="module")
def noted(client):
    [run] = runs_of(client)
    return run


@pytest.fixture
def tracking(swept, tmp_path):
    """A database of the test's own, without the seconds that making one takes."""
    return shutil.copytree(swept.tracking, tmp_path / "tracking ü'")


def test_every_figure_is_a_metric(swept, noted):
    run = swept.read(1, "run.json")
    expected = {key(name): value for name, value in told(swept.read(1, "table.json")).items()}
    expected |= {f"seconds/{stage}": seconds for stage, seconds in run["seconds"].items()}
    expected |= {"peak memory MiB": run["peak_memory_mib"]}
    losses = {name for name in noted.data.metrics if name.startswith("training/")}
    assert {name: value for name, value in noted.data.metrics.items() if name not in losses} == expected
    assert {"FD:AD/all/top-5 low", "localisation/recall at 5", "FD/all/lc-AUROC"} <= set(noted.data.metrics)


def test_losses_run_over_epochs_and_folds(swept, client, noted):
    found = []
    for place in ("place 0", "place 1"):
        both = []
        for kind in ("L1 of each epoch", "held-out L1 of each fold"):
            points = client.get_metric_history(noted.info.run_id, f"training/world/{place}/{kind}")
            points.sort(key=lambda point: point.step)
            assert [point.step for point in points] == [*range(1, len(points) + 1)]
            both.append([point.value for point in points])
        found.append(tuple(both))
    assert sorted(found) == sorted(stored_losses(swept.base))


def test_the_run_is_finished_under_its_name_with_its_configuration(swept, noted):
    assert (noted.info.run_name, noted.info.status) == (f"{swept.sweep.name}/1", "FINISHED")
    assert noted.data.params == read_record(swept.sweep / "1", "x").parameters


def test_files_and_pictures_are_artefacts(swept, noted):
    kept = Path(unquote(urlparse(noted.info.artifact_uri).path))
    assert kept.is_relative_to(swept.tracking)
    job = swept.sweep / "1"
    for path in [one for one in job.rglob("*") if one.is_file()]:
        at = Path("pictures", path.name) if path.suffix == ".png" else path.relative_to(job)
        assert (kept / at).read_bytes() == path.read_bytes()


def test_a_run_is_noted_down_once_and_one_that_failed_again(swept, tracking, monkeypatch):
    settings = Tracker("mlflow", str(tracking))

    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(mlflow, "_fill", full)
        with pytest.raises(InputError, match=r"No space left on device.*the run is whole in"):
            track(settings, swept.sweep / "0", "x")
    for _ in range(2):
        track(settings, swept.sweep / "0", "x")
    states = [run.info.status for run in runs_of(client_of(tracking)) if run.info.run_name == "x"]
    assert sorted(states) == ["FAILED", "FINISHED"]


def test_many_losses_and_long_values_go_in(swept, tracking):
    record = read_record(swept.sweep / "0", "x")
    epochs = [(step, 1 / step) for step in range(1, 2502)]
    record = replace(record, name="long", parameters={f"a.{i}": "v" * 9000 for i in range(250)})
    MLflow(tracking).note(replace(record, curves={("training", "m" * 400): epochs}))
    client = client_of(tracking)
    [run] = runs_of(client, "long")
    assert {len(value) for value in run.data.params.values()} == {6000}
    assert len(run.data.params) == 250
    history = client.get_metric_history(run.info.run_id, key(("training", "m" * 400)))
    assert sorted((point.step, point.value) for point in history) == epochs


PARTS = st.text(st.sampled_from("ab+@/._x2_: %\n√") | st.characters(codec="utf-8"), max_size=8)
WORDS = st.sampled_from([":", " at ", "_x2f_", "_x_", "..", ".", "..0"])
NAMES = st.lists(st.lists(PARTS | WORDS, max_size=3).map("".join), min_size=1, max_size=3).map(tuple)


@given(NAMES)
def test_any_name_is_one_that_mlflow_takes(name):
    _validate_metric_name(key(name))


@given(NAMES, NAMES)
def test_different_names_stay_different(one, other):
    assert (key(one) == key(other)) == (one == other)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("a+b", "a:b"),
        ("a@b", "a at b"),
        ("a at@", "a@at "),
        ("_x2/", "\x02x2f_"),
        ("a/b", "a_x2f_b"),
        ("", "_x_"),
        (".", "_x2e_"),
        ("m" * 300, "m" * 301),
    ],
)
def test_look_alikes_stay_different(one, other):
    assert key((one,)) != key((other,))
    assert len(key((one,))) <= 250
