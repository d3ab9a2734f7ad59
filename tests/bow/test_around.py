"""Oracle: reference.nearest_word, every word of an image looked at."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fdslam.bow import around
from fdslam.bow.around import NONE, candidates, nearest_around
from fdslam.types import Features
from tests import reference


@settings(deadline=None)
@given(st.integers(0, 10_000), st.integers(0, 12), st.integers(0, 12), st.sampled_from([0.5, 3.0, 5.0, 40.0]))
def test_the_nearest_word_equals_the_loops(seed, count, others, radius):
    rng = np.random.default_rng(seed)
    at = rng.integers(0, 12, (count, 2)).astype(float)  # whole numbers: some lie at exactly the radius
    query = rng.integers(0, 256, (count, 32), np.uint8)
    other = Features(rng.integers(0, 12, (others, 2)).astype(np.float32), rng.integers(0, 256, (others, 32), np.uint8))
    expected = reference.nearest_word(query, at, other.xy, other.descriptors, radius, NONE)
    for native in (True, False):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(around, "NATIVE", native)
            assert nearest_around(query, at, other, radius).tolist() == expected


def test_both_ways_are_the_same_on_an_image_full_of_keypoints(monkeypatch):
    rng = np.random.default_rng(0)
    query, bits = rng.integers(0, 256, (2, 1500, 32), np.uint8)
    other = Features(rng.uniform(0, [480, 360], (1500, 2)).astype(np.float32), bits)
    at = rng.uniform(-60, 540, (1500, 2))
    found = []
    for native in (True, False):
        monkeypatch.setattr(around, "NATIVE", native)
        found.append([nearest_around(query, at, other, radius) for radius in (0.3, 20.0, 900.0)])
    for one, two in zip(*found, strict=True):
        assert one.dtype == two.dtype
        assert np.array_equal(one, two)
    assert found[0][0].max() == NONE > found[0][2].max()


def test_candidates_are_the_best_hypotheses_and_what_lies_beside_them():
    assert candidates([7, 0, 3, 9], 8, 3, 1) == [0, 1, 2, 3, 4, 6, 7]
    assert candidates([7, 0, 3, 9], 8, 1, 2) == [5, 6, 7]
    assert candidates([5, 3], 8, 2, 0) == [3, 5]
    assert candidates(np.array([], np.int64), 8, 3, 1) == []


@given(st.permutations(range(9)), st.integers(1, 12), st.integers(0, 10))
def test_candidates_equal_the_loop_over_the_map(hypotheses, best, neighbours):
    chosen = hypotheses[:best]
    expected = [m for m in range(9) if any(abs(m - one) <= neighbours for one in chosen)]
    assert candidates(hypotheses, 9, best, neighbours) == expected
