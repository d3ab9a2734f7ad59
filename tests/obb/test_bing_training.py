"""BING's trainer on a world of bright rectangles; overlap against loops."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdslam.errors import InputError
from fdslam.obb.bing import digest, proposals
from fdslam.obb.bing.filters import SIZES
from fdslam.obb.bing.training import Scene, Training, Windows, fit_first, fit_second, judged, train, windows
from fdslam.obb.overlap import NEVER, first_found, iou
from tests.reference import bing as reference

NONE = np.empty((0, 4), np.float32)


def scene(seed):
    """A few rectangles on noise: objects by their outline alone."""
    rng = np.random.default_rng(seed)
    image = rng.integers(90, 120, (96, 128, 3)).astype(np.uint8)
    boxes = []
    for _ in range(2):
        w, h = rng.integers(18, 50, 2)
        x, y = rng.integers(0, 128 - w), rng.integers(0, 96 - h)
        image[y : y + h, x : x + w] = rng.integers(150, 256)
        boxes.append((x, y, x + w, y + h))
    return Scene(image, np.array(boxes, np.float32), NONE)


def plain_iou(a, b):
    """By counting the pixels of whole-numbered boxes."""
    first = {(x, y) for x in range(a[0], a[2]) for y in range(a[1], a[3])}
    second = {(x, y) for x in range(b[0], b[2]) for y in range(b[1], b[3])}
    return len(first & second) / len(first | second) if first | second else 0


BOX = st.tuples(*[st.integers(0, 9)] * 4).map(lambda b: (b[0], b[1], b[0] + b[2], b[1] + b[3]))


@given(st.lists(BOX, max_size=4), st.lists(BOX, max_size=3))
def test_iou(boxes, others):
    found = iou(np.array(boxes).reshape(-1, 4), np.array(others).reshape(-1, 4))
    assert found.shape == (len(boxes), len(others))
    assert np.allclose(found, [[plain_iou(a, b) for b in others] for a in boxes] if boxes else found)
    first = first_found(np.array(boxes).reshape(-1, 4), np.array(others).reshape(-1, 4), 0.5)
    expected = [next((i for i, a in enumerate(boxes, 1) if plain_iou(a, b) >= 0.5), NEVER) for b in others]
    assert first.tolist() == expected


def test_training_finds_what_it_was_shown():
    scenes = [scene(i) for i in range(12)]
    settings = Training(least=5)
    filters = train(scenes, "maxbgr", settings)
    assert {SIZES[i] for i in filters.sizes} >= {(32, 32)}
    assert filters.second[:, 0].max() > 0
    unseen = [scene(1000 + i) for i in range(12)]
    needed = np.concatenate([first_found(proposals(s.image, filters, 20)[0], s.objects, 0.5) for s in unseen])
    rng = np.random.default_rng(0)
    by_chance = []
    for s in unseen:
        corner = rng.uniform(0, 70, (20, 2))
        by_chance.append(
            first_found(np.concatenate([corner, corner + rng.uniform(18, 50, (20, 2))], 1), s.objects, 0.5)
        )
    assert (needed <= 20).mean() > 0.7
    assert (np.concatenate(by_chance) <= 20).mean() < 0.5
    assert digest([train(scenes, "maxbgr", settings, workers=3)]) == digest([filters])
    assert digest([train(scenes, "maxbgr", replace(settings, seed=1))]) != digest([filters])


def test_windows_are_on_or_beside():
    one = scene(0)
    found = windows(one, "grey", 5, np.random.default_rng(0))
    assert found.gradients.shape == (len(found.on), 8, 8)
    assert found.on.any()
    for size in set(found.sizes.tolist()):
        assert np.count_nonzero(~found.on[found.sizes == size]) <= 5
    hidden = Scene(one.image, NONE, one.objects)
    apart = windows(hidden, "grey", 5, np.random.default_rng(0))
    assert not apart.on.any()
    assert np.array_equal(apart.gradients, found.gradients[~found.on])


def test_what_is_ignored_is_neither_right_nor_wrong():
    one = scene(1)
    filters = train([scene(i) for i in range(12)], "maxbgr", Training(least=5))
    known, hidden, unknown = (
        judged(Scene(one.image, *boxes), filters) for boxes in ((one.objects, NONE), (NONE, one.objects), (NONE, NONE))
    )
    on = sum(row[1].sum() for row in known)
    assert on > 0
    assert not any(row[1].any() for row in hidden + unknown)
    assert sum(len(row[0]) for row in hidden) == sum(len(row[0]) for row in known) - on
    assert sum(len(row[0]) for row in unknown) == sum(len(row[0]) for row in known)


def test_stage_one_does_not_learn_which_sizes_are_frequent():
    """Bright windows of one size, nearly all on objects, and dark ones of another: inside a size nothing to tell."""
    rng = np.random.default_rng(0)
    sizes = np.repeat([0, 7], 2000)
    on = rng.uniform(0, 1, 4000) < np.where(sizes == 0, 0.9, 0.1)
    bright = np.where(sizes == 0, 150, 50)[:, None, None] + rng.integers(-40, 40, (4000, 8, 8))
    first, active = fit_first(Windows(bright.astype(np.uint8), sizes, on), Training())
    assert active.tolist() == [0, 7]
    assert abs(first.sum()) * 100 < 0.3  # what 100 levels of brightness change, where classes are ±1
    known = np.array(rng.uniform(0, 1, 4000) < 0.5)
    told, _ = fit_first(Windows((bright + 60 * known[:, None, None]).astype(np.uint8), sizes, known), Training())
    assert told.sum() * 100 > 0.6


def test_stage_two_estimates_the_chance_that_a_window_is_on_an_object():
    rng = np.random.default_rng(0)
    scores = rng.uniform(0, 1, 40_000).astype(np.float32)
    on = rng.uniform(0, 1, 40_000) < 0.3 * scores
    v, t = fit_second(scores, on, Training())
    assert v == pytest.approx(0.6, abs=0.03)  # 2 P - 1
    assert t == pytest.approx(-1, abs=0.02)


def test_too_little_to_learn_from():
    with pytest.raises(InputError, match="train on more annotated images"):
        train([Scene(scene(0).image, NONE, NONE)], "maxbgr", Training())


def test_training_sees_the_gradients_of_the_oracle():
    image = scene(2).image[:40, :40]
    found = windows(Scene(image, np.array([[0, 0, 32, 32]], np.float32), NONE), "maxbgr", 0, np.random.default_rng(0))
    at = np.flatnonzero(found.sizes == SIZES.index((64, 64)))  # cut to the image: one window, 8 × 8
    assert found.on[at].tolist() == [True]
    small = cv2.resize(image, (8, 8), interpolation=cv2.INTER_LINEAR_EXACT)
    assert np.array_equal(found.gradients[at[0]], reference.gradient(small, "maxbgr"))
