from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fdslam.config import Fd
from fdslam.detectors.fault_diagnosis import PRIOR, loc_cells, loc_pixels, near_keypoints, unsupported, with_support
from fdslam.types import CELL
from tests import reference

SWITCHES = list(
    product(
        ("min", "mean", "max", "median"), ("fuse_then_pool", "pool_then_fuse"), ("harmonic", "arithmetic", "geometric")
    )
)


def scene(seed, height, width, count=6, hypotheses=4):
    rng = np.random.default_rng(seed)
    x = np.sort(rng.uniform(-5, width + 5, (count, 2)), axis=1)
    y = np.sort(rng.uniform(-5, height + 5, (count, 2)), axis=1)
    boxes = np.stack([x[:, 0], y[:, 0], x[:, 1], y[:, 1]], axis=1).astype(np.float32)
    boxes[: count // 2] = np.rint(boxes[: count // 2])
    return boxes, rng.integers(1, 30, (count, hypotheses)).astype(np.int32)


@pytest.mark.parametrize(("pooling", "order", "mean"), SWITCHES)
@pytest.mark.parametrize(("seed", "weights"), [(0, "equal"), (1, "equal"), (2, "area"), (3, "area")])
def test_every_switch_equals_the_loop_over_pixels(pooling, order, mean, seed, weights):
    height, width = 23, 37
    boxes, ranks = scene(seed, height, width)
    config = Fd(pooling=pooling, order=order, mean=mean, weights=weights)
    expected = reference.fault_diagnosis(boxes, ranks, height, width, pooling, order, mean, weights)
    assert np.allclose(loc_pixels(boxes, ranks, height, width, config), expected, rtol=1e-6, atol=0)
    cells = loc_cells(boxes, ranks, height, width, config)
    assert cells.dtype == np.float32
    assert np.allclose(cells, reference.cell_maximum(expected, CELL), rtol=1e-6, atol=0)


@given(st.integers(0, 10_000), st.sampled_from(SWITCHES), st.sampled_from(["equal", "area"]))
def test_order_of_obbs_changes_nothing(seed, switches, weights):
    boxes, ranks = scene(seed, 40, 50, count=9)
    mixed = np.random.default_rng(seed).permutation(len(boxes))
    config = Fd(**dict(zip(("pooling", "order", "mean"), switches, strict=True)), weights=weights)
    plain = loc_cells(boxes, ranks, 40, 50, config)
    assert np.array_equal(plain, loc_cells(boxes[mixed], ranks[mixed], 40, 50, config))


@pytest.mark.parametrize(("pooling", "order", "mean"), SWITCHES)
def test_outside_all_boxes_and_without_boxes_it_is_zero(pooling, order, mean):
    config = Fd(pooling=pooling, order=order, mean=mean)
    loc = loc_pixels(np.array([[10, 10, 20, 20]], np.float32), np.array([[7, 9]], np.int32), 30, 30, config)
    assert (loc[:10] == 0).all()
    assert (loc[10:20, 10:20] > 0).all()
    nothing = loc_cells(np.zeros((0, 4), np.float32), np.zeros((0, 2), np.int32), 30, 30, config)
    assert (nothing == 0).all()
    without_hypotheses = loc_cells(np.array([[0, 0, 30, 30]], np.float32), np.zeros((1, 0), np.int32), 30, 30, config)
    assert (without_hypotheses == 0).all()


def test_one_wrong_hypothesis_does_not_hide_an_agreement():
    # The box ranks the second hypothesis first: the minimum says no change there.
    boxes = np.array([[0, 0, 30, 30], [0, 0, 15, 30]], np.float32)
    ranks = np.array([[1, 4], [9, 1]], np.int32)
    loc = loc_pixels(boxes, ranks, 30, 30, Fd())
    assert loc[0, 0] == pytest.approx(min(2 / (1 / 1 + 1 / 9), 2 / (1 / 4 + 1 / 1)))
    assert loc[0, 20] == 1


@given(st.integers(0, 10_000), st.integers(1, 63), st.integers(1, 63), st.integers(0, 12), st.integers(0, 4))
def test_the_gate_equals_the_loop_over_cells(seed, height, width, count, reach):
    xy = (np.random.default_rng(seed).random((count, 2)) * (width - 0.01, height - 0.01)).astype(np.float32)
    found = near_keypoints(xy, height, width, reach)
    assert np.array_equal(found, reference.near_keypoints(xy, height, width, reach))


@settings(deadline=None)
@given(st.integers(0, 10_000), st.integers(0, 30))
def test_unsupported_keypoints_are_averaged_as_the_loops_do(seed, count):
    rng = np.random.default_rng(seed)
    xy = (rng.random((count, 2)) * (60, 40)).astype(np.float32)
    bits = rng.integers(0, 258, count)
    share = unsupported(xy, bits, 40, 60, Fd(support_distance=70, support_sigma=1.2))
    expected = reference.cells_normalised(xy, (bits > 70).astype(np.float32), 40, 60, 1.2, PRIOR)
    assert np.allclose(share, expected, rtol=1e-5, atol=1e-6)
    assert 0 <= share.min() <= share.max() <= 1


def test_ranks_and_support_add_up():
    ranks = np.array([[0, 1, 10, 100]], np.float32)
    share = np.array([[1, 0, 0.5, 1]], np.float32)
    assert np.allclose(with_support(ranks, share, 100, Fd(support=2.0)), [[0, 1, 2.5, 4]])
    assert np.allclose(with_support(ranks[:, :2], share[:, :2], 1, Fd(support=1.0)), [[0, 1]])  # one map image
