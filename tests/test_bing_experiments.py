"""What the scripts around BING promise: figures counted as said, files written, refusals in one line."""

import sys
from pathlib import Path

import numpy as np
import pytest

from experiments.obb_study import detection_rate
from experiments.speed import bing as speed
from experiments.train import bing as training
from experiments.train import scenes as scenes_module
from experiments.train.scenes import annotated_scenes, campus_scenes, load
from fdslam.config import Folder
from fdslam.data.campus import SESSIONS, View
from fdslam.data.folder import read_folder
from fdslam.errors import InputError
from fdslam.obb.bing import load_filters, proposals
from fdslam.obb.bing.training import Scene
from tests.data.worlds import small_world

IMAGE = np.zeros((40, 60, 3), np.uint8)


def boxes(*rows):
    return np.array(rows, np.float32).reshape(-1, 4)


def test_rates_count_objects_found_among_the_first_n():
    found, missed = (0, 0, 20, 20), (30, 20, 60, 40)
    scenes = [
        Scene(IMAGE, boxes(found, missed), boxes()),
        Scene(IMAGE, boxes(found), boxes()),
        Scene(IMAGE, boxes(), boxes()),
    ]
    curve = detection_rate.rates(scenes, lambda image, rng: boxes((0, 0, 5, 5), (0, 0, 20, 12), found))
    assert curve.shape == (detection_rate.MOST,)
    assert curve[:3].tolist() == pytest.approx([0, 2 / 3, 2 / 3])  # 12 rows of 20: IoU 0.6
    assert curve[-1] == pytest.approx(2 / 3)


def test_random_boxes_are_seeded_and_inside():
    one, again, other = (detection_rate.random_boxes(40, 60, 500, np.random.default_rng(s)) for s in (0, 0, 1))
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)
    assert (one[:, :2] >= 0).all()
    assert (one[:, 2:] <= [60, 40]).all()
    assert (one[:, 2:] - one[:, :2] >= 16 - 1e-9).all()


def test_the_study_prints_tables_and_draws(quick_campus, monkeypatch, tmp_path, capsys):
    root = small_world(tmp_path / "world")
    monkeypatch.setattr(detection_rate, "RUNS", 2)
    arguments = ["study", str(root), "--images", "4", "--workers", "1", "--plot", str(tmp_path / "plot.png")]
    monkeypatch.setattr(sys, "argv", arguments)
    detection_rate.main()
    printed = capsys.readouterr().out
    assert "| world: 2 objects; n = | 1 | 5 |" in printed
    assert "| campus: " in printed
    for name in ("BING, ours", "random boxes", "templates J+B (19)", "all templates (47)"):
        assert printed.count(f"| {name} |") == 2
    assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")


def test_every_source_of_the_study_has_a_style(tmp_path):
    published = Path(__file__).parents[2] / "shared" / "data" / "models" / "bing"
    names = {name for name, *_ in detection_rate.sources(published if published.is_dir() else None)}
    assert names <= detection_rate.STYLES.keys()
    assert len(names) >= 4


class Campus:
    """In the place of a World, which takes long: image i of a session is of brightness i and shows two objects."""

    def __init__(self, seed, images, width, height):
        self.seed, self.size = seed, (height, width, 3)
        self.count = {session: images // len(SESSIONS) for session in SESSIONS}

    def view(self, session, index):
        image = np.full(self.size, 10 * SESSIONS.index(session) + index, np.uint8)
        near, far = (self.seed, 5, self.seed + 80, 65), (9, 9, 11, 11)
        return View(image, None, None, np.arange(2), boxes(near, far), np.array([True, False]), (0, 0, 0))


@pytest.fixture
def quick_campus(monkeypatch):
    monkeypatch.setattr(scenes_module, "World", Campus)


@pytest.mark.parametrize("workers", [1, 3])
def test_campus_scenes_are_all_sessions_in_order(quick_campus, workers):
    scenes = list(campus_scenes([3, 7], 8, workers))
    assert [int(scene.image[0, 0, 0]) for scene in scenes] == [0, 1, 10, 11, 20, 21, 30, 31] * 2
    assert {scene.image.shape for scene in scenes} == {(404, 308, 3)}
    assert [scene.objects.tolist() for scene in scenes] == [[[3, 5, 83, 65]]] * 8 + [[[7, 5, 87, 65]]] * 8
    assert all(scene.ignored.tolist() == [[9, 9, 11, 11]] for scene in scenes)


def test_data_sets_are_scenes(tmp_path):
    root = small_world(tmp_path / "world")
    (data,) = load(["dataset=folder", f"dataset.root={root}"], 1)
    scenes = list(annotated_scenes([data, data]))
    assert [scene.objects.tolist() for scene in scenes] == [[], [[40, 60, 80, 100]], [], [[40, 60, 80, 100]], [], []]
    (root / "annotations.json").unlink()
    with pytest.raises(InputError, match="has no annotations"):
        list(annotated_scenes([read_folder(root, Folder())]))


@pytest.mark.parametrize("words", [["dataset=nonsense"], ["dataset=folder"], ["dataset.rooot=1"], ["x"]])
def test_what_is_no_data_set_is_refused(words):
    with pytest.raises(InputError) as caught:
        load(words, 1)
    assert "\n" not in str(caught.value)


def test_training_from_a_folder(monkeypatch, tmp_path, capsys):
    root = small_world(tmp_path / "world", count=8, changed=(0, 1, 2, 3, 4, 5, 6, 7))
    out = tmp_path / "out.safetensors"
    monkeypatch.setattr(
        sys, "argv", ["bing", "--out", str(out), "--space", "hsv", "dataset=folder", f"dataset.root={root}"]
    )
    training.main()
    (filters,) = load_filters(out)
    assert filters.space == "hsv"
    assert "trained on 8 objects in 8 images" in capsys.readouterr().out
    scenes = list(annotated_scenes([read_folder(root, Folder())]))
    curve = detection_rate.rates(scenes, lambda image, _: proposals(image, filters, 100)[0])
    assert curve[99] == 1  # they were shown: the patch stands at one place in all of them


def test_the_benchmark_measures_what_it_names():
    image = np.random.default_rng(0).integers(0, 256, (48, 64, 3), dtype=np.uint8)
    works = speed.works(image)
    assert next(iter(works)).startswith("baseline")
    assert len(speed.filters("maxbgr").sizes) == 28
    for work in works.values():
        work()
