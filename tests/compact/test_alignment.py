"""Views made from a known scene: which keypoints another view shares is known."""

import numpy as np

from fdslam.bow.verification import supporting_matches
from fdslam.compact.alignment import LEAST, align
from fdslam.config import Alignment
from fdslam.types import Features
from tests.bow.test_verification import features, seen_from_elsewhere

SIZE, OTHER_SIZE = (480, 640), (500, 600)


def aligned(images, order, most=3):
    query = seen_from_elsewhere(3)[0]
    config = Alignment(images=most)
    return query, align(query, SIZE, order, images.__getitem__, lambda m: OTHER_SIZE, config)


def views():
    """A map of other places, two views of the query's, one of which shows less of it, and an empty image."""
    other = seen_from_elsewhere(3)[1]
    less = Features(other.xy[:50], other.descriptors[:50])
    return [features(9, 80), less, other, Features(other.xy[:0], other.descriptors[:0]), features(10, 80)]


def test_those_with_most_agreeing_keypoints_come_first():
    images = views()
    query, found = aligned(images, [0, 1, 2, 3, 4])
    assert [one.image for one in found] == [2, 1]
    assert len(found[0].here) > len(found[1].here) >= LEAST
    for one in found:
        mine, theirs = supporting_matches(query, images[one.image], LEAST)
        assert np.array_equal(one.here, query.xy[mine])
        assert np.array_equal(one.there, images[one.image].xy[theirs])
        assert one.size == SIZE
        assert one.other_size == OTHER_SIZE
        assert one.other is images[one.image]
    again = aligned(images, [4, 3, 2, 1, 0])[1]
    assert [one.image for one in again] == [2, 1]
    assert [one.image for one in aligned(images, [0, 1, 2, 3, 4], most=1)[1]] == [2]


def test_equal_ones_go_by_their_id():
    images = views()
    images[4] = images[2]
    assert [one.image for one in aligned(images, [4, 2, 1])[1]] == [2, 4, 1]


def test_another_place_is_not_aligned():
    images = views()
    assert aligned(images, [0, 3, 4])[1] == []
    assert aligned(images, [])[1] == []


def test_flows_lead_there_and_back():
    [best] = aligned(views(), [2])[1]
    there, back = best.to_map.at(best.here), best.to_query.at(best.there)
    assert np.median(np.abs(there - best.there)) < np.median(np.abs(best.here - best.there)) / 3
    assert np.median(np.abs(back - best.here)) < np.median(np.abs(best.here - best.there)) / 3
    assert best.to_map is best.to_map  # computed once
