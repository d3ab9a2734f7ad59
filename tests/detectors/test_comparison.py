"""Oracle: reference (every cell and keypoint; every pair of cells)."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fdslam.config import Pc
from fdslam.detectors.comparison import keypoints_to_cells
from tests import reference


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 63), st.integers(1, 63), st.integers(0, 30), st.booleans())
def test_cells_against_loops(seed, height, width, n, whole):
    rng = np.random.default_rng(seed)
    xy = (rng.random((n, 2)) * (width, height)).astype(np.float32)
    xy = np.floor(xy) if whole else np.minimum(xy, np.nextafter(np.array([width, height], np.float32), np.float32(0)))
    value = (500 * rng.random(n)).astype(np.float32)
    oracle = reference.cells_maximum(xy, value, height, width)
    cells = keypoints_to_cells(xy, value, height, width, Pc(spread="cell"))
    assert cells.dtype == np.float32
    np.testing.assert_array_equal(cells, oracle)
    order = rng.permutation(n)
    for sigma in (0.4, 1.5):
        smooth = keypoints_to_cells(xy, value, height, width, Pc(spread="gaussian", spread_sigma=sigma))
        assert smooth.dtype == np.float32
        np.testing.assert_allclose(smooth, reference.blurred(oracle, sigma), rtol=1e-5, atol=1e-4)
        np.testing.assert_array_equal(
            keypoints_to_cells(xy[order], value[order], height, width, Pc(spread="gaussian", spread_sigma=sigma)),
            smooth,
        )


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 63), st.integers(1, 63), st.integers(0, 30))
def test_normalised_against_loops(seed, height, width, n):
    rng = np.random.default_rng(seed)
    xy = np.floor(rng.random((n, 2)) * (width, height)).astype(np.float32)
    value = (500 * rng.random(n)).astype(np.float32)
    order = rng.permutation(n)
    for sigma, prior in ((0.4, 0.15), (1.5, 2.0)):
        config = Pc(spread="normalised", spread_sigma=sigma, spread_prior=prior)
        ours = keypoints_to_cells(xy, value, height, width, config)
        assert ours.dtype == np.float32
        np.testing.assert_allclose(
            ours, reference.cells_normalised(xy, value, height, width, sigma, prior), rtol=1e-5, atol=1e-4
        )
        np.testing.assert_array_equal(keypoints_to_cells(xy[order], value[order], height, width, config), ours)


def test_normalised_says_the_same_of_many_and_of_few():
    # One keypoint in a cell, or nine: with a small prior the value is theirs, and halfway between it is the mean.
    xy = np.array([[5, 5]] * 9 + [[305, 5]], np.float32)
    config = Pc(spread="normalised", spread_prior=1e-6)
    cells = keypoints_to_cells(xy, np.full(10, 200, np.float32), 10, 310, config)
    np.testing.assert_allclose(cells[0, [0, 30]], 200, rtol=1e-4)
    blurred = keypoints_to_cells(xy, np.full(10, 200, np.float32), 10, 310, Pc(spread="normalised"))
    assert blurred[0, 15] == 0  # far from both
    assert 0 < blurred[0, 30] < blurred[0, 0] < 200


def test_cells_by_hand():
    xy = np.array([[0, 0], [9, 9], [10, 9], [24, 12], [24, 12]], np.float32)
    cells = keypoints_to_cells(xy, np.array([1, 3, 2, 7, 5], np.float32), 13, 25, Pc(spread="cell"))
    np.testing.assert_array_equal(cells, [[3, 2, 0], [0, 0, 7]])
    empty = keypoints_to_cells(np.empty((0, 2), np.float32), np.empty(0, np.float32), 13, 25, Pc(spread="gaussian"))
    np.testing.assert_array_equal(empty, np.zeros((2, 3)))


@pytest.mark.parametrize("xy", [(25, 0), (0, 13), (-1, 0), (0, -0.5), (np.nan, 0)])
def test_keypoint_outside(xy):
    with pytest.raises(ValueError, match="outside the image of 25 × 13"):
        keypoints_to_cells(np.array([xy], np.float32), np.ones(1, np.float32), 13, 25, Pc(spread="cell"))


@pytest.mark.parametrize("value", [-1, np.nan, np.inf])
def test_bad_value(value):
    with pytest.raises(ValueError, match="negative or not finite"):
        keypoints_to_cells(np.zeros((1, 2), np.float32), np.array([value], np.float32), 13, 25, Pc(spread="cell"))
