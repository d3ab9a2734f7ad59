"""Oracle: reference.compact.smallest, loops over displacements, descriptors and the cells around."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fdslam.compact import comparison
from fdslam.compact.comparison import NOWHERE, displaced, smallest
from fdslam.compact.grid import Grid
from tests.reference import compact as reference
from tests.reference.compact import centre


def bits(rng, rows, cols, words):
    few = rng.integers(0, 2**64, (3, words), dtype=np.uint64)  # so that equal descriptors occur
    near = few[rng.integers(0, 3, (rows, cols))]
    return near ^ (rng.integers(0, 2**64, near.shape, np.uint64) & rng.integers(0, 2**64, near.shape, np.uint64))


def equal(query, image, grid, at, reach, sigma=0.8):
    alone, supported = smallest(query, image, grid, at, reach, sigma)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(comparison, "NATIVE", not comparison.NATIVE)  # with compiled loops or without, to the bit
        assert [one.tobytes() for one in smallest(query, image, grid, at, reach, sigma)] == [
            alone.tobytes(),
            supported.tobytes(),
        ]
    for found, expected in zip(
        (alone, supported), reference.smallest(query, image, grid, at, reach, sigma, np.inf), strict=True
    ):
        assert found.dtype == np.float32
        assert np.array_equal(np.isinf(found), np.isinf(expected))
        known = ~np.isinf(expected)
        assert np.allclose(found[known], expected[known], rtol=1e-4, atol=1e-3)
    return alone, supported


SIDES = st.integers(1, 6)


@settings(deadline=None, max_examples=40)
@given(
    st.integers(0, 10_000),
    st.tuples(SIDES, SIDES),
    st.tuples(SIDES, SIDES),
    st.integers(1, 4),
    st.sampled_from([0.0, 3.0, 9.5, 21.7]),
    st.sampled_from([0.3, 0.7, 1.2]),
)
def test_any_place_equals_the_loops(seed, shape, other, words, reach, sigma):
    rng = np.random.default_rng(seed)
    grid = Grid(*other, rng.uniform(5, 11), rng.uniform(5, 11))
    at = rng.uniform(-20, 70, (shape[0] * shape[1], 2))
    equal(bits(rng, *shape, words), bits(rng, *other, words), grid, at, reach, sigma)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000), st.tuples(SIDES, SIDES), st.integers(0, 2), st.floats(4, 20))
def test_places_that_are_centres_equal_the_loops(seed, shape, cells, step):
    rng = np.random.default_rng(seed)
    query, image, grid = bits(rng, *shape, 2), bits(rng, 5, 6, 2), Grid(5, 6, step, step)
    row, col = rng.integers(0, (5, 6), (shape[0] * shape[1], 2)).T
    equal(query, image, grid, np.stack(centre(grid, row, col), axis=1), cells * step)


@pytest.mark.parametrize(("far", "cells"), [((0, 0), 7), ((14, 14), 7), ((4, 10), 3)])
def test_a_cell_at_exactly_the_reach_is_looked_at_and_none_further(far, cells):
    rng, query, image = np.random.default_rng(0), np.zeros((1, 1, 1), np.uint64), np.ones((15, 15, 1), np.uint64)
    image[far] = 0  # so many cells from the middle in x and in y
    for step in rng.uniform(2, 30, 20):  # whatever rounding makes of it
        grid = Grid(15, 15, step, step)
        at = np.array([centre(grid, 7, 7)])
        assert smallest(query, image, grid, at, cells * step, 1.0)[0][0, 0] == 0
        assert smallest(query, image, grid, at, (cells - 1) * step, 1.0)[0][0, 0] == 1
        found = [*displaced(query, image, grid, at, cells * step)]
        assert len(found) == (2 * cells + 1) ** 2


@settings(deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.0, 8.0, 20.0]))
def test_every_displacement_comes_once(seed, reach):
    rng = np.random.default_rng(seed)
    query, image, grid = bits(rng, 3, 4, 2), bits(rng, 4, 5, 2), Grid(4, 5, 8.0, 9.0)
    at = rng.uniform(-5, 50, (12, 2))
    found = [*displaced(query, image, grid, at, reach)]
    expected = [*reference.displaced(query, image, grid, at, reach)]
    assert len(found) == len(expected)
    for (distance, inside), loops in zip(found, expected, strict=True):
        assert np.array_equal(inside, [[one is not None for one in row] for row in loops])
        assert np.array_equal(distance, [[one or 0 for one in row] for row in loops])


def test_elsewhere_is_nowhere():
    rng = np.random.default_rng(0)
    query, image, grid = bits(rng, 2, 3, 1), bits(rng, 4, 4, 1), Grid(4, 4, 8.0, 8.0)
    at = np.tile([[-100.0, 10.0]], (6, 1))
    at[4] = 12, 12
    for found in equal(query, image, grid, at, 16):
        assert (np.delete(found.ravel(), 4) == NOWHERE).all()
        assert found[1, 1] < NOWHERE
    # Those that are nowhere have no weight: the only one that is somewhere supports itself.
    alone, supported = smallest(query, image, grid, at, 16, 1.0)
    assert supported[1, 1] == pytest.approx(alone[1, 1])


def test_support_wants_neighbours_of_the_same_displacement():
    rng = np.random.default_rng(1)
    image = rng.integers(0, 2**64, (12, 12, 1), dtype=np.uint64)
    grid, at = Grid(12, 12, 8.0, 8.0), Grid(12, 12, 8.0, 8.0).centres()
    moved = np.roll(image, 1, axis=1)  # all by one cell: whatever supports a cell says the same
    alone, supported = smallest(moved, image, grid, at, 8, 1.0)
    assert alone[:, 4:-4].max() == 0
    assert supported[:, 5:-5].max() < 1e-3
    mixed = image.copy()
    mixed[5, 5] = image[5, 6]  # one cell that is moved alone has no support
    alone, supported = smallest(mixed, image, grid, at, 8, 1.0)
    assert alone[5, 5] == 0
    assert supported[5, 5] > 1
