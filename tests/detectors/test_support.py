"""Views made from a known scene: which keypoints another view shares is known."""

import numpy as np

from fdslam.bow.around import NONE
from fdslam.config import Support
from fdslam.detectors.support import support
from fdslam.types import Features
from tests.bow.test_verification import features, seen_from_elsewhere


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
