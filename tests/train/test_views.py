"""Training views against ``World.view`` and against the label image."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.train import views as module
from experiments.train.views import CLASSES, LOOP, TEST, TRAINING, VALIDATION, FramedWorld, Views, joined, load
from fdslam.config import Campus
from fdslam.data.campus import World
from fdslam.data.campus.layout import moved
from fdslam.data.campus.objects import KINDS
from fdslam.data.campus.raster import resolve

SIZE = 96, 128  # width, height
SEED = 7
SHOWN = (*(("SU", k) for k in range(0, 40, 5)), ("WI", 11))


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


def depth(world: FramedWorld, session: str, index: int) -> np.ndarray:
    camera = world.camera(session, index)
    buffers, _ = world.populate(session, camera, world.static(session, camera))
    return resolve(buffers).depth


def test_a_thing_that_stands_still_is_framed_where_the_view_changes_without_it(pairs):
    world, both = pairs
    checked = 0
    for (session, index), (framed, plain) in zip(SHOWN, both, strict=True):
        n, day, whole = len(plain.items), world.day(session), depth(world, session, index)
        placed = moved(world.layout, SEED, session)
        things = [k for k in np.unique(day.mesh.item) if k >= len(world.items)]
        near = sorted(things, key=lambda k: np.hypot(*(placed[k - len(world.items)].at - plain.pose[:2])))[:12]
        boxes = []
        for k in near:
            kept = np.flatnonzero(day.mesh.item != k)
            arrays = {name: value[kept] for name, value in vars(day.mesh).items() if name != "textures"}
            less = replace(day.mesh, **arrays, textures=tuple(day.mesh.textures[q] for q in kept))
            world._days[session] = replace(day, mesh=less)
            gone = depth(world, session, index) != whole
            world._days[session] = day
            if np.count_nonzero(gone) >= 12:
                rows, columns = np.flatnonzero(gone.any(1)), np.flatnonzero(gone.any(0))
                box = columns[0], rows[0], columns[-1] + 1, rows[-1] + 1
                boxes.append((CLASSES.index(placed[k - len(world.items)].kind), box))
        for kind, box in boxes:
            same = framed.boxes[n:][framed.classes[n:] == kind]
            # By samples a box may reach one pixel farther than by pixels.
            assert (np.abs(same - box).max(1) <= 1).any(), (session, index, CLASSES[kind], box)
            checked += 1
    assert checked >= 5


def test_the_campuses_are_apart_and_none_is_the_users():
    groups = [set(TRAINING), set(VALIDATION), set(TEST)]
    assert sum(map(len, groups)) == len(set.union(*groups))
    assert Campus().seed not in set.union(*groups)
    assert set(KINDS) <= set(CLASSES)


def test_views_come_back_from_the_store_as_they_were(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "SESSIONS", ("SU",))
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
