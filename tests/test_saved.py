"""Saved maps, and maps that grow: what is written where. Detections before are the oracle of those after."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import fdslam
from fdslam import ChangeDetector
from fdslam.data.images import read_image
from fdslam.data.live import file_frame
from fdslam.errors import InputError
from fdslam.report.page.records import Records
from fdslam.saved import as_utf8, new_folder, read_manifest
from tests.compact.walks import walk
from tests.test_api import files, made


@pytest.fixture
def world(tmp_path):
    return walk(tmp_path / "world", count=6)


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_an_update_leaves_the_folder_that_was_loaded_as_it_is(world, tmp_path):
    images, query = files(world / "map"), world / "query" / "1.png"
    made("CC", None).fit(images[:4]).save(tmp_path / "saved")
    before = contents(tmp_path / "saved")
    detector = ChangeDetector.load(tmp_path / "saved").update(images[4:])
    assert contents(tmp_path / "saved") == before
    expected = made("CC", None).fit(images).detect(query).cells
    assert np.array_equal(detector.detect(query).cells, expected)
    detector.save(tmp_path / "saved")  # now its own
    assert np.array_equal(detector.detect(query).cells, expected)
    assert np.array_equal(ChangeDetector.load(tmp_path / "saved").detect(query).cells, expected)
    assert len(ChangeDetector.load(tmp_path / "saved")) == 6


def test_an_update_does_not_learn_from_what_has_taken_a_map_images_place(world, tmp_path):
    images = files(world / "map")
    detector = made("CC", None).fit(images[:4])
    shutil.copy(images[5], images[1])
    with pytest.raises(
        InputError, match=rf"CC learn from all map images, and 1 are others than .* {images[1]}; fit all"
    ):
        detector.update(images[4:])
    assert len(detector) == 4
    assert len(made("FD", None, more=["fd.support=0"]).fit(images[:4]).update(images[4:])) == 6


def test_a_map_that_grows_keeps_one_file_of_itself(world):
    images = [read_image(path) for path in files(world / "map")]
    detector = made("FD", None).fit(images[:2])
    for image in images[2:]:
        detector.update([image])
    assert len(list((detector._store.root / "map").rglob("*.safetensors"))) == 1
    assert np.array_equal(detector.detect(images[3]).cells, made("FD", None).fit(images).detect(images[3]).cells)


def test_a_users_file_beside_a_saved_map_is_not_lost(world, tmp_path):
    detector = made("FD", None).fit(world / "map")
    detector.save(tmp_path / "saved")
    (tmp_path / "saved" / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match=r"holds notes\.txt beside the saved map"):
        detector.save(tmp_path / "saved")
    assert (tmp_path / "saved" / "notes.txt").read_text() == "mine"


def test_an_interruption_while_a_map_takes_its_place_leaves_the_old_one(tmp_path, monkeypatch):
    folder = tmp_path / "saved"
    with new_folder(folder) as made_:
        (made_ / "map.json").write_text("old")
    rename = type(folder).rename

    def interrupted(path, target):
        if path.name == "map":
            raise KeyboardInterrupt
        return rename(path, target)

    monkeypatch.setattr(type(folder), "rename", interrupted)
    with pytest.raises(KeyboardInterrupt), new_folder(folder) as made_:
        (made_ / "map.json").write_text("new")
    assert (folder / "map.json").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["saved"]


@pytest.mark.parametrize("poses", ["x", [[1, 2]], [[1, 2, 3]] * 2])
def test_poses_that_are_none_are_a_damaged_map(poses, tmp_path):
    told = {"format": 1, "settings": {"mode": "best", "detectors": "FD"}, "poses": poses}
    told["images"] = [["a.png", "/a.png", "0" * 64, 100, 100]]
    (tmp_path / "map.json").write_bytes(as_utf8(told))
    with pytest.raises(InputError, match="cannot be read as a saved map"):
        read_manifest(tmp_path)


def test_names_that_are_no_unicode_are_read_as_they_were():
    assert json.loads(as_utf8({"ü": "\udcff"})) == {"ü": "\udcff"}
    assert "ü".encode() in as_utf8({"ü": 1})


def test_the_page_does_not_show_what_has_taken_a_map_images_place(world):
    images, query = files(world / "map"), world / "query" / "1.png"
    detector = made("FD", None).fit(images)
    outcome = detector.outcome([file_frame(query)])
    best = int(outcome.hypotheses[0][0])
    shutil.copy(images[best - 1], images[best])
    shown = Records(outcome, detector.config).frames(0)
    assert [one.there for one in shown.values() if one.frame.path == images[best]] == [False]
    assert sum(one.there for one in shown.values()) == len(shown) - 1


def test_a_model_that_has_moved_is_named_anew(world, tmp_path):
    shipped = Path(fdslam.__file__).parent / "weights" / "yolo_campus.onnx"
    model = shutil.copy(shipped, tmp_path / "model.onnx")
    settings = ["obb.library=J+YOLO", f"obb.yolo.weights={model}"]
    made("FD", None, more=settings).fit(world / "map").save(tmp_path / "saved")
    expected = ChangeDetector.load(tmp_path / "saved").detect(world / "query" / "1.png")
    model.rename(tmp_path / "moved.onnx")
    with pytest.raises(InputError, match=r"model\.onnx: no such file.*name what has moved with settings=\[KEY=VALUE\]"):
        ChangeDetector.load(tmp_path / "saved")
    found = ChangeDetector.load(tmp_path / "saved", [f"obb.yolo.weights={tmp_path / 'moved.onnx'}"])
    assert np.array_equal(found.detect(world / "query" / "1.png").cells, expected.cells)
