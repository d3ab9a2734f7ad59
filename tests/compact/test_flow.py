"""Oracle: bow.alignment.predicted, the same model summed over all matches at every point; and plain Gaussian sums."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fdslam.bow import alignment
from fdslam.bow.alignment import FEWEST, NEAR, WIDE, predicted
from fdslam.compact.flow import flow
from tests.bow.test_alignment import matches
from tests.reference.compact import gaussian_sum

HEIGHT, WIDTH = 360, 480
SIDE = float(np.sqrt(HEIGHT * WIDTH))


def lattice(found):
    rows, cols = found.field.shape[:2]
    return np.stack(np.meshgrid(np.arange(cols), np.arange(rows)), axis=2).reshape(-1, 2) * found.step


def moved(seed, count, shift=0.0):
    """Matches whose residuals are large: part of them lie on something nearer."""
    here, there = matches(seed, count)
    there[here[:, 0] > WIDTH / 2] += np.float32(shift)
    return here, there


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000), st.integers(FEWEST, 40), st.sampled_from([0.0, 15.0]))
def test_at_the_lattice_it_is_the_sum_over_all_matches(seed, count, shift):
    here, there = moved(seed, count, shift)
    found = flow(here, there, HEIGHT, WIDTH)
    at = lattice(found)
    assert at[-1, 0] >= WIDTH
    assert at[-1, 1] >= HEIGHT
    # predicted takes float32, the lattice is computed in float64: what rounding of a point makes is far below this.
    expected = predicted(at.astype(np.float32), here, there, SIDE)
    assert np.abs(found.at(at) - expected).max() < 1e-3


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000), st.integers(FEWEST, 40))
def test_between_it_is_close(seed, count):
    here, there = moved(seed, count, 15)
    xy = (np.random.default_rng(seed).random((50, 2)) * (WIDTH, HEIGHT)).astype(np.float32)
    found, expected = flow(here, there, HEIGHT, WIDTH).at(xy), predicted(xy, here, there, SIDE)
    away = np.abs(expected - alignment.with_one(xy.astype(float)) @ flow(here, there, HEIGHT, WIDTH).model).max()
    assert np.abs(found - expected).max() < 0.05 * away + 0.05  # pixels; the lattice has under two steps a σ


@given(st.integers(0, 10_000), st.integers(0, FEWEST - 1))
def test_with_few_matches_nothing_moves_and_nothing_is_known(seed, count):
    here, there = matches(seed, count)
    found, xy = flow(here, there, HEIGHT, WIDTH), np.array([[3, 4], [470.5, 350.25]])
    assert np.array_equal(found.at(xy), xy)
    assert not found.confidence(xy).any()


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000), st.integers(FEWEST, 25))
def test_confidence_counts_the_matches_around(seed, count):
    here, there = matches(seed, count)
    found = flow(here, there, HEIGHT, WIDTH)
    at = lattice(found)[np.random.default_rng(seed).integers(0, found.field.shape[0] * found.field.shape[1], 12)]
    expected = [[gaussian_sum(p, here.tolist(), sigma * SIDE) for sigma in (NEAR, WIDE)] for p in at.tolist()]
    confidence = found.confidence(at)
    assert confidence.dtype == np.float32
    assert np.allclose(confidence, expected, rtol=1e-4, atol=1e-5)


def test_far_from_all_matches_nothing_is_known():
    here = (np.random.default_rng(0).random((20, 2)) * 30).astype(np.float32)
    near, wide = flow(here, here + 5, HEIGHT, WIDTH).confidence(np.array([[20, 20], [470, 350]])).T
    assert near[0] > 10
    assert wide[0] > 15
    assert near[1] == pytest.approx(0, abs=1e-9)
    assert wide[1] < 1e-6


def test_a_stray_match_bends_nothing():
    here, there = matches(0, 40)
    xy = np.array([[0, 0], [479, 359], [240, 100]], np.float32)
    plain = flow(here, there, HEIGHT, WIDTH).at(xy)
    stray = np.concatenate([there, there[:1] + 300]).astype(np.float32)
    assert np.abs(flow(np.concatenate([here, here[:1]]), stray, HEIGHT, WIDTH).at(xy) - plain).max() < 1


@pytest.mark.parametrize(("height", "width"), [(16, 4000), (4000, 16), (8, 8), (3000, 4000)])
def test_any_size_of_image(height, width):
    rng = np.random.default_rng(0)
    here = (rng.random((30, 2)) * (width, height)).astype(np.float32)
    xy = rng.random((40, 2)) * (width, height)
    found = flow(here, here + 2, height, width)
    assert np.allclose(found.at(xy), xy + 2, atol=0.05)


def test_so_many_points_as_a_large_image_has_cells():
    here, there = moved(1, 30, 15)
    found = flow(here, there, HEIGHT, WIDTH)
    xy = np.random.default_rng(0).random((70_001, 2)) * (WIDTH, HEIGHT)
    some = [0, 1, 32_767, 40_000, 70_000]
    assert np.array_equal(found.at(xy)[some], found.at(xy[some]))
    assert np.array_equal(found.confidence(xy)[some], found.confidence(xy[some]))
    assert found.at(xy[:0]).shape == (0, 2)
    assert found.confidence(xy[:0]).shape == (0, 2)
