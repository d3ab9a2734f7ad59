"""BING against tests/reference/bing.py, on random images and filters of our own making."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdslam.errors import InputError
from fdslam.obb.bing import Filters, bing_boxes, gradient, own_filters, proposals
from fdslam.obb.bing import binary as binary_module
from fdslam.obb.bing.binary import binarise, score_map
from fdslam.obb.bing.filters import SIZES
from fdslam.obb.bing.gradient import SPACES, normed_gradient
from fdslam.obb.bing.suppression import best_windows
from tests.reference import bing as reference

RNG = np.random.default_rng


def noise(height, width, seed=0, levels=256):
    return (RNG(seed).integers(0, levels, (height, width, 3)) * (255 // (levels - 1))).astype(np.uint8)


def blocks(height, width, seed=0):
    """Rectangles on a plain ground: ties and large flat areas."""
    rng, image = RNG(seed), np.full((height, width, 3), 90, np.uint8)
    for _ in range(6):
        y, x = rng.integers(0, height), rng.integers(0, width)
        image[y : y + rng.integers(4, 40), x : x + rng.integers(4, 40)] = rng.integers(0, 256, 3)
    return image


def filters(space="maxbgr", seed=0, sizes=(0, 1, 6, 7, 8, 14, 21)):
    rng = RNG(seed)
    second = np.stack([rng.uniform(0, 20, len(sizes)), rng.uniform(-1.1, -0.9, len(sizes))], axis=1)
    return Filters(
        space, rng.normal(0, 1e-3, (8, 8)).astype(np.float32), np.array(sizes, np.int32), second.astype("f4")
    )


@pytest.fixture(params=["compiled", "arrays"])
def native(request, monkeypatch):
    """Gradients by compiled loops, and without."""
    if request.param == "arrays":
        monkeypatch.setattr(gradient, "NATIVE", False)


@pytest.mark.parametrize("space", SPACES)
@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (2, 1), (1, 9), (9, 1), (2, 3), (3, 2), (17, 23)])
def test_gradient(space, shape, native):
    for image in (noise(*shape), noise(*shape, levels=4), blocks(*shape)):
        assert np.array_equal(normed_gradient(image, space), reference.gradient(image, space))


def test_gradients_saturate(native):
    step = np.zeros((9, 9, 3), np.uint8)
    step[5:, 5:] = [100, 200, 250]
    step[:2, :2] = 255
    for space in SPACES:
        assert normed_gradient(step, space).max() == 255
        assert np.array_equal(normed_gradient(step, space), reference.gradient(step, space))


@given(st.integers(0, 2**32 - 1))
def test_binary_filter(seed):
    weights = RNG(seed).normal(0, 1, (8, 8)).astype(np.float32)
    beta, signs = binarise(weights)
    expected, rows = reference.binarise(weights)
    assert beta.tolist() == expected
    assert [f"{int(a):064b}" for a in signs] == ["".join("1" if s > 0 else "0" for s in row) for row in rows]


@pytest.mark.parametrize("native", [True, False])
@pytest.mark.parametrize("shape", [(8, 8), (8, 11), (13, 8), (7, 20), (20, 7), (1, 1), (19, 23)])
def test_score_map(shape, native, monkeypatch):
    monkeypatch.setattr(binary_module, "NATIVE", native and binary_module.NATIVE)
    gradient = RNG(1).integers(0, 256, shape, dtype=np.uint8)
    weights = RNG(2).normal(0, 1e-3, (8, 8)).astype(np.float32)
    found = score_map(gradient, *binarise(weights))
    assert found.dtype == np.float32
    assert np.array_equal(found, reference.score_map(gradient, weights))


def test_score_is_the_product_with_the_binary_filters():
    gradient = RNG(3).integers(0, 256, (8, 8), dtype=np.uint8)
    weights = RNG(4).normal(0, 1e-3, (8, 8)).astype(np.float32)
    beta, signs = reference.binarise(weights)
    near = sum(b * np.reshape(a, (8, 8)) for b, a in zip(beta, signs, strict=True))
    assert score_map(gradient, *binarise(weights))[0, 0] == pytest.approx((near * (gradient >> 4)).sum(), rel=1e-5)
    assert np.corrcoef(near.ravel(), weights.ravel())[0, 1] > 0.8  # two binary filters are most of the filter


@pytest.mark.parametrize("levels", [1, 3, 10_000])
@pytest.mark.parametrize(("shape", "count"), [((30, 40), 9), ((30, 40), 1000), ((1, 7), 3), ((3, 3), 2), ((0, 4), 3)])
def test_suppression(levels, shape, count):
    scores = RNG(5).integers(0, levels, shape).astype(np.float32)
    kept = best_windows(scores, 2, count)
    assert [divmod(int(k), shape[1]) for k in kept] == reference.best_windows(scores, 2, count)


@pytest.mark.parametrize("shape", [(33, 47), (16, 16), (20, 64), (50, 9)])
@pytest.mark.parametrize("make", [noise, blocks])
@pytest.mark.parametrize("spaces", [("maxbgr",), ("grey", "hsv", "maxbgr")])
def test_ranking(shape, make, spaces):
    image = make(*shape, seed=6)
    several = [filters(space, seed) for seed, space in enumerate(spaces)]
    told = [
        (f.space, f.first, {SIZES[i]: tuple(map(float, row)) for i, row in zip(f.sizes, f.second, strict=True)})
        for f in several
    ]
    for count in (0, 7, 10_000):
        expected = reference.proposals(image, told, count)
        boxes, scores = proposals(image, several, count)
        assert (boxes.dtype, scores.dtype) == (np.float32, np.float32)
        assert boxes.tolist() == [list(box) for _, box in expected]
        assert scores.tolist() == [float(score) for score, _ in expected]


def test_boxes_lie_inside_once_each_and_fall_in_score():
    image = blocks(200, 300)
    boxes, scores = proposals(image, filters(sizes=range(36)), 5000)
    assert len(boxes) > 1000
    assert (boxes[:, :2] >= 0).all()
    assert (boxes[:, 2:] <= [300, 200]).all()
    assert (boxes[:, 2:] - boxes[:, :2] >= 14).all()
    assert len(np.unique(boxes, axis=0)) == len(boxes)
    assert (np.diff(scores) <= 0).all()
    assert set(map(tuple, boxes[:, 2:] - boxes[:, :2])) >= {(16, 16), (64, 64), (300, 200)}


def test_prefix_of_more_is_fewer():
    image = blocks(120, 90)
    many, few = (proposals(image, filters(), n) for n in (400, 40))
    assert np.array_equal(many[0][:40], few[0])
    assert np.array_equal(many[1][:40], few[1])


@pytest.mark.parametrize("shape", [(1, 1), (1, 300), (7, 7), (300, 7)])
def test_an_image_without_room_has_no_proposals(shape):
    boxes, scores = proposals(noise(*shape), filters(sizes=range(36)), 50)
    assert (boxes.shape, scores.shape) == ((0, 4), (0,))


def test_an_image_smaller_than_every_window_is_one():
    boxes, _ = proposals(noise(9, 12), filters(sizes=range(36)), 50)
    assert boxes.tolist() == [[0, 0, 12, 9]]


def test_grey_images():
    grey = noise(40, 50)[..., 0]
    expected = proposals(np.repeat(grey[..., None], 3, axis=2), filters(), 30)
    for image in (grey, grey[..., None]):
        boxes, scores = proposals(image, filters(), 30)
        assert np.array_equal(boxes, expected[0])
        assert np.array_equal(scores, expected[1])


@pytest.mark.parametrize(
    "image", [np.zeros((40, 40), np.uint16), np.zeros((40, 40, 3), np.float32), np.zeros((40, 40, 4), np.uint8)]
)
def test_other_images_are_refused(image):
    with pytest.raises(InputError, match=r"must be 8 bit, grey or RGB"):
        proposals(image, filters(), 5)


def test_views_and_threads_change_nothing():
    image = blocks(90, 120)
    before = image.copy()
    wide = np.zeros((90, 240, 3), np.uint8)
    wide[:, ::2] = image
    expected = proposals(image, filters(), 200)
    with ThreadPoolExecutor(4) as pool:
        for boxes, scores in pool.map(lambda one: proposals(one, filters(), 200), [image, wide[:, ::2]] * 6):
            assert np.array_equal(boxes, expected[0])
            assert np.array_equal(scores, expected[1])
    assert np.array_equal(image, before)


def test_source_of_the_library():
    image = blocks(404, 308)
    boxes = bing_boxes(image)
    assert (boxes.shape, boxes.dtype) == ((50, 4), np.float32)
    assert np.array_equal(boxes, proposals(image, own_filters(), 50)[0])
    assert np.array_equal(bing_boxes(image, filters(), 7), proposals(image, filters(), 7)[0])
