"""Training views against ``World.view`` and against the label image."""

import numpy as np
import pytest

from experiments.train import views as module
from experiments.train.views import CLASSES, LOOP, TEST, TRAINING, VALIDATION, FramedWorld, Views, joined, load
from fdslam.config import Campus
from fdslam.data.campus import World
from fdslam.data.campus.objects import KINDS
from fdslam.data.campus.scene import OBJECT

SIZE = 96, 128  # width, height
SEED = 7
SHOWN = (("SU", 3), ("SU", 30), ("WI", 11))


@pytest.fixture(scope="module")
def pairs():
    framed, plain = (make(SEED, 4 * LOOP, *SIZE) for make in (FramedWorld, World))
    return framed, [(framed.framed(*which), plain.view(*which)) for which in SHOWN]


def test_what_the_world_shows_and_frames_is_kept(pairs):
    world, both = pairs
    for framed, plain in both:
        assert (framed.images[0] == plain.image).all()
        assert (framed.labels[0] == plain.labels).all()
        n = len(plain.items)
        assert (framed.boxes[:n] == plain.boxes).all()
        assert (framed.clear[:n] == plain.clear).all()
        assert [CLASSES[c] for c in framed.classes[:n]] == [world.items[k].kind for k in plain.items]


def test_things_that_stand_still_are_framed_too(pairs):
    _, both = pairs
    stood = 0
    for framed, plain in both:
        for box, clear in zip(framed.boxes[len(plain.items) :], framed.clear[len(plain.items) :], strict=True):
            x0, y0, x1, y1 = box.astype(int)
            labels = framed.labels[0, y0:y1, x0:x1]
            # The box is tight by samples and the label image by pixels: every side is within a pixel of the object.
            assert (labels == OBJECT).any() or not clear
            stood += bool(clear)
    assert stood >= 3


def test_every_object_pixel_of_a_framed_kind_is_in_a_box(pairs):
    world, both = pairs
    day = world.day("SU")
    framed_only = {k for k in np.unique(day.mesh.item) if k >= 0}
    assert len(framed_only) > 50
    assert min(framed_only) >= len(world.items)
    for framed, _ in both:
        assert (framed.boxes[:, 2:] > framed.boxes[:, :2]).all()
        assert framed.boxes.min() >= 0
        assert (framed.boxes.max(0) <= (*SIZE, *SIZE)).all()


def test_the_campuses_are_apart_and_none_is_the_users():
    groups = [set(TRAINING), set(VALIDATION), set(TEST)]
    assert sum(map(len, groups)) == len(set.union(*groups))
    assert Campus().seed not in set.union(*groups)
    assert set(KINDS) <= set(CLASSES)


def test_views_come_back_from_the_store_as_they_were(tmp_path, monkeypatch):
    first = load(tmp_path, [SEED], 48, SIZE[1], SIZE[0])
    monkeypatch.setattr(module, "render", lambda *_: pytest.fail("rendered again"))
    again = load(tmp_path, [SEED], 48, SIZE[1], SIZE[0])
    for name, views in first.items():
        for field, value in vars(views).items():
            assert (value == getattr(again[name], field)).all(), field
        assert len(views.images) == LOOP // 48


def test_joined_views_keep_their_objects():
    def some(n: int, objects: list[int]) -> Views:
        k = len(objects)
        return Views(
            np.zeros((n, 4, 4, 3), np.uint8),
            np.zeros((n, 4, 4), np.uint8),
            np.zeros(n, bool),
            np.array(objects, np.int64),
            np.arange(k),
            np.tile(np.arange(k, dtype=np.float32)[:, None], (1, 4)),
            np.ones(k, bool),
        )

    both = joined([some(2, [0, 1, 1]), some(3, [2])])
    assert both.view.tolist() == [0, 1, 1, 4]
    assert both.of(4)[1].tolist() == [[0, 0, 0, 0]]
    assert both.of(1)[0].tolist() == [1, 2]
    assert both.of(3)[0].tolist() == []
