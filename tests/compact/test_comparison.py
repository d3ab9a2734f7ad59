"""Oracle: reference.compact.around, every descriptor of the query against every one of the map image."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fdslam.compact.comparison import NOWHERE, around
from fdslam.compact.grid import Grid
from tests.reference import compact as reference
from tests.reference.compact import centre


def bits(rng, rows, cols, words):
    few = rng.integers(0, 2**64, (3, words), dtype=np.uint64)  # so that equal descriptors occur
    near = few[rng.integers(0, 3, (rows, cols))]
    return near ^ (rng.integers(0, 2**64, near.shape, dtype=np.uint64) & rng.integers(0, 2**64, near.shape, np.uint64))


def equal(query, image, grid, at, reach):
    found = around(query, image, grid, at, reach)
    smallest, mean = reference.around(query, image, grid, at, reach, NOWHERE)
    assert found.smallest.dtype == np.int32
    assert found.mean.dtype == np.float32
    assert np.array_equal(found.smallest, smallest)
    assert np.allclose(found.mean, mean, rtol=1e-6, atol=0)
    return found


SIDES = st.integers(1, 6)


@settings(deadline=None)
@given(
    st.integers(0, 10_000),
    st.tuples(SIDES, SIDES),
    st.tuples(SIDES, SIDES),
    st.integers(1, 4),
    st.sampled_from([0.0, 3.0, 9.5, 31.7]),
)
def test_any_place_equals_the_loops(seed, shape, other, words, reach):
    rng = np.random.default_rng(seed)
    grid = Grid(*other, rng.uniform(5, 11), rng.uniform(5, 11))
    at = rng.uniform(-20, 70, (shape[0] * shape[1], 2))
    equal(bits(rng, *shape, words), bits(rng, *other, words), grid, at, reach)


@settings(deadline=None)
@given(st.integers(0, 10_000), st.tuples(SIDES, SIDES), st.integers(0, 3), st.floats(4, 20))
def test_a_centre_at_exactly_the_reach_counts(seed, shape, cells, step):
    rng = np.random.default_rng(seed)
    query, image = bits(rng, *shape, 2), bits(rng, 5, 6, 2)
    grid = Grid(5, 6, step, step)
    row, col = rng.integers(0, (5, 6), (shape[0] * shape[1], 2)).T
    at = np.stack(centre(grid, row, col), axis=1)
    found = equal(query, image, grid, at, cells * step)
    one = equal(query, image, grid, at, 0)  # none but the descriptor at that very centre
    assert (found.smallest <= one.smallest).all()
    assert np.array_equal(one.smallest, one.mean)


def test_no_step_makes_rounding_decide_at_the_reach():
    rng, query, image = np.random.default_rng(0), np.zeros((1, 1, 1), np.uint64), np.zeros((7, 7, 1), np.uint64)
    for corner in ((0, 0), (0, 6), (6, 0), (6, 6)):
        image[:] = 1
        image[corner] = 0  # three cells from the middle in x and in y
        for step in rng.uniform(2, 30, 80):
            grid = Grid(7, 7, step, step)
            at = np.array([centre(grid, 3, 3)])
            assert around(query, image, grid, at, 3 * step).smallest[0, 0] == 0
            assert around(query, image, grid, at, 2.999 * step).smallest[0, 0] == 1


def test_elsewhere_is_nowhere():
    rng = np.random.default_rng(0)
    query, image, grid = bits(rng, 2, 3, 1), bits(rng, 4, 4, 1), Grid(4, 4, 8.0, 8.0)
    at = np.tile([[-100.0, 10.0]], (6, 1))
    at[4] = 12, 12
    found = equal(query, image, grid, at, 16)
    assert (np.delete(found.smallest.ravel(), 4) == NOWHERE).all()
    assert found.smallest[1, 1] < NOWHERE
    assert found.mean[0, 0] == 0


def test_one_pixel_more_or_less_of_reach_decides():
    query, image = np.zeros((1, 1, 1), np.uint64), np.array([[[7], [1], [0]]], np.uint64)
    grid = Grid(1, 3, 8.0, 8.0)  # centres at x 4, 12, 20
    at = np.array([[4.0, 4.0]])
    smallest = [int(around(query, image, grid, at, reach).smallest[0, 0]) for reach in (0, 7.99, 8, 15.99, 16, 99)]
    assert smallest == [3, 3, 1, 1, 0, 0]
    means = [float(around(query, image, grid, at, reach).mean[0, 0]) for reach in (0, 8, 16)]
    assert means == pytest.approx([3, 2, 4 / 3])
