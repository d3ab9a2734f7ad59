from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdslam.config import Fd
from fdslam.detectors.fault_diagnosis import loc_cells, loc_pixels
from fdslam.types import CELL
from tests import reference

SWITCHES = list(
    product(("min", "mean", "max", "median"), ("fuse_then_pool", "pool_then_fuse"), ("harmonic", "arithmetic"))
)


def scene(seed, height, width, count=6, hypotheses=4):
    rng = np.random.default_rng(seed)
    x = np.sort(rng.uniform(-5, width + 5, (count, 2)), axis=1)
    y = np.sort(rng.uniform(-5, height + 5, (count, 2)), axis=1)
    boxes = np.stack([x[:, 0], y[:, 0], x[:, 1], y[:, 1]], axis=1).astype(np.float32)
    boxes[: count // 2] = np.rint(boxes[: count // 2])
    return boxes, rng.integers(1, 30, (count, hypotheses)).astype(np.int32)


@pytest.mark.parametrize(("pooling", "order", "mean"), SWITCHES)
@pytest.mark.parametrize("seed", range(3))
def test_every_switch_equals_the_loop_over_pixels(pooling, order, mean, seed):
    height, width = 23, 37
    boxes, ranks = scene(seed, height, width)
    config = Fd(pooling=pooling, order=order, mean=mean)
    expected = reference.fault_diagnosis(boxes, ranks, height, width, pooling, order, mean)
    assert np.allclose(loc_pixels(boxes, ranks, height, width, config), expected, rtol=1e-6, atol=0)
    cells = loc_cells(boxes, ranks, height, width, config)
    assert cells.dtype == np.float32
    assert np.allclose(cells, reference.cell_maximum(expected, CELL), rtol=1e-6, atol=0)


@given(st.integers(0, 10_000), st.sampled_from(SWITCHES))
def test_order_of_obbs_changes_nothing(seed, switches):
    boxes, ranks = scene(seed, 40, 50, count=9)
    mixed = np.random.default_rng(seed).permutation(len(boxes))
    config = Fd(*switches)
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
