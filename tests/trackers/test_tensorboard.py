"""What TensorBoard's own reader finds in the events, against the run's table.json and files."""

import shutil

import numpy as np
import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensorboard.plugins.hparams import metadata

from fdslam.config import Tracker
from fdslam.trackers import track
from fdslam.trackers.record import read_record
from fdslam.trackers.tensorboard import tag
from tests.trackers.test_record import stored_losses, told


@pytest.fixture(scope="module")
def events(swept):
    folder = swept.tracking / "tensorboard" / "fd_ad" / swept.sweep.name / "0"
    return EventAccumulator(str(folder), size_guidance={"scalars": 0, "images": 0, "tensors": 0}).Reload()


def scalar(events, name):
    [found] = events.Tensors(tag(name))
    return float(found.tensor_proto.float_val[0])


def test_every_figure_is_a_scalar(swept, events):
    expected = told(swept.read(0, "table.json"))
    expected |= {("seconds", stage): s for stage, s in swept.read(0, "run.json")["seconds"].items()}
    for name, value in expected.items():
        assert scalar(events, name) == np.float32(value), name
    assert "FD+AD/all/top-5" in events.Tags()["tensors"]


def test_losses_run_over_epochs_and_folds(swept, events):
    found = []
    for place in ("place 0", "place 1"):
        both = []
        for kind in ("L1 of each epoch", "held-out L1 of each fold"):
            name = tag(("training", "world", place, kind))  # none where a place has nothing to hold out
            points = events.Tensors(name) if name in events.Tags()["tensors"] else []
            assert [point.step for point in points] == [*range(1, len(points) + 1)]
            both.append([float(point.tensor_proto.float_val[0]) for point in points])
        found.append(tuple(both))
    assert sorted(found) == sorted(stored_losses(swept.base))


def test_pictures_are_the_files_bytes(swept, events):
    job = swept.sweep / "0"
    for path in (job / "curves.png", *(job / "pictures").glob("*.png")):
        [image] = events.Images(f"pictures/{path.stem}")
        assert image.encoded_image_string == path.read_bytes()
        assert (image.height, image.width) != (0, 0)


def test_the_table_is_a_text_and_the_configuration_hyperparameters(swept, events):
    [text] = events.Tensors("table")
    assert text.tensor_proto.string_val[0].decode() == (swept.sweep / "0" / "table.md").read_text()
    data = events.SummaryMetadata(metadata.SESSION_START_INFO_TAG).plugin_data.content
    hparams = metadata.parse_session_start_info_plugin_data(data).hparams
    assert hparams["ad.k"].number_value == 2
    assert hparams["fd.pooling"].string_value == "min"
    assert set(hparams) == set(read_record(swept.sweep / "0", "x").parameters)


def test_the_files_lie_beside_the_events(swept):
    folder = swept.tracking / "tensorboard" / "fd_ad" / swept.sweep.name / "0"
    for path in (swept.sweep / "0").iterdir():
        if path.is_file() and path.suffix != ".png":
            assert (folder / path.name).read_bytes() == path.read_bytes()
    assert list(swept.tracking.glob(".unfinished*")) == []


def test_a_run_is_noted_down_once_and_another_of_its_name_beside_it(swept, tmp_path):
    settings = Tracker("tensorboard", str(tmp_path / "t"))
    first, second = (shutil.copytree(swept.sweep / "0", tmp_path / name / "out") for name in ("a", "b"))
    for folder in (first, second, first, second):
        track(settings, folder, "out")
    assert sorted(path.name for path in (tmp_path / "t" / "tensorboard" / "fd_ad").iterdir()) == ["out", "out_2"]


def test_a_kill_leaves_nothing_that_is_shown(swept, tmp_path, monkeypatch):
    settings = Tracker("tensorboard", str(tmp_path))

    def killed(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("fdslam.trackers.tensorboard.shutil.copyfile", killed)
        with pytest.raises(KeyboardInterrupt):
            track(settings, swept.sweep / "0", "x")
    assert list(tmp_path.rglob("*tfevents*")) == []
    track(settings, swept.sweep / "0", "x")
    assert len(list(tmp_path.rglob("*tfevents*"))) == 1


def test_names_of_parts_make_no_groups():
    assert tag(("training", "a/b", "50 %")) == "training/a%2Fb/50 %25"
