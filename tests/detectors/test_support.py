"""Oracle: reference.nearest_word, every word of every image looked at; and views made from a known scene."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fdslam.config import Support
from fdslam.detectors.support import NONE, candidates, nearest_word, support
from fdslam.types import Features
from tests import reference
from tests.bow.test_verification import features, seen_from_elsewhere


@settings(deadline=None)
@given(st.integers(0, 10_000), st.integers(0, 12), st.integers(0, 12), st.sampled_from([0.5, 3.0, 5.0, 40.0]))
def test_the_nearest_word_equals_the_loops(seed, count, others, radius):
    rng = np.random.default_rng(seed)
    at = rng.integers(0, 12, (count, 2)).astype(float)  # whole numbers: some lie at exactly the radius
    query = rng.integers(0, 256, (count, 32), np.uint8)
    other = Features(rng.integers(0, 12, (others, 2)).astype(np.float32), rng.integers(0, 256, (others, 32), np.uint8))
    expected = reference.nearest_word(query, at, other.xy, other.descriptors, radius, NONE)
    assert nearest_word(query, at, other, radius).tolist() == expected


def test_candidates_are_the_best_hypotheses_and_what_lies_beside_them():
    assert candidates([7, 0, 3, 9], 8) == [0, 1, 2, 3, 4, 6, 7]
    assert candidates(np.array([], np.int64), 8) == []


def test_what_the_map_has_seen_is_supported_and_what_is_new_is_not():
    query, other = seen_from_elsewhere(3)
    images = [features(9, 80), other, features(10, 80), Features(query.xy[:0], query.descriptors[:0])]
    distance = support(query, 400.0, [0, 1, 2, 3], images.__getitem__, Support(support_images=1))
    assert (distance[:60] <= 60).mean() > 0.9
    assert (distance[60:] > 60).all()
    again = support(query, 400.0, [3, 2, 1, 0], images.__getitem__, Support(support_images=1))
    assert np.array_equal(distance, again)
    more = support(query, 400.0, [0, 1, 2, 3], images.__getitem__, Support(support_images=4))
    assert (more <= distance).all()


def test_without_images_or_keypoints_there_is_no_support():
    query, other = seen_from_elsewhere(3)
    assert (support(query, 400.0, [], [].__getitem__, Support()) == NONE).all()
    nothing = Features(query.xy[:0], query.descriptors[:0])
    assert support(nothing, 400.0, [0], [other].__getitem__, Support()).shape == (0,)
