"""Oracle: reference.predicted, normal equations and loops over points and matches."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fdslam.bow import alignment
from fdslam.bow.alignment import FEWEST, predicted
from tests import reference

CONSTANTS = (alignment.FEWEST, alignment.STEPS, alignment.SCALE, alignment.STRAY, alignment.NEAR, alignment.WIDE)


def matches(seed, count, strays=0):
    rng = np.random.default_rng(seed)
    here = (rng.random((count, 2)) * (480, 360)).astype(np.float32)
    there = here @ np.array([[1.1, 0.05], [-0.04, 0.95]]) + (12, -7) + rng.normal(0, 2, (count, 2))
    there[:strays] += 200
    return here, there.astype(np.float32)


@settings(deadline=None)
@given(st.integers(0, 10_000), st.integers(0, 20), st.integers(0, 30), st.integers(0, 2))
def test_equals_the_loops(seed, points, count, strays):
    here, there = matches(seed, count, min(strays, count))
    xy = (np.random.default_rng(seed + 1).random((points, 2)) * (480, 360)).astype(np.float32)
    found = predicted(xy, here, there, 415.0)
    assert found.shape == (points, 2)
    expected = np.array(reference.predicted(xy, here, there, 415.0, *CONSTANTS)).reshape(points, 2)
    assert np.allclose(found, expected, rtol=0, atol=1e-5)


def test_an_affine_map_is_found_in_spite_of_a_stray_match():
    here, _ = matches(0, 40)
    model = np.array([[1.1, 0.05], [-0.04, 0.95]])
    there = (here @ model + (12, -7)).astype(np.float32)
    there[3] += (90, -90)
    xy = np.array([[0, 0], [479, 359], [240, 100]], np.float32)
    assert np.allclose(predicted(xy, here, there, 415.0), xy @ model + (12, -7), atol=0.5)


def test_with_few_matches_nothing_moves():
    here, there = matches(1, FEWEST - 1)
    xy = np.array([[3, 4]], np.float32)
    assert np.array_equal(predicted(xy, here, there, 415.0), xy)
