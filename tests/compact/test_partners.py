"""Oracle: reference.nearest_word, and a loop over the images."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fdslam.bow.around import NONE
from fdslam.compact.alignment import Aligned
from fdslam.compact.partners import missing_words, new_keypoints
from fdslam.types import Features
from tests import reference

SIZE = (60, 90)


def some(rng, count, pool):
    descriptors = pool[rng.integers(0, len(pool), count)] ^ (rng.random((count, 32)) < 0.1).astype(np.uint8)
    return Features((rng.random((count, 2)) * (89, 59)).astype(np.float32), descriptors)


def scene(seed, images=2):
    rng = np.random.default_rng(seed)
    pool = rng.integers(0, 256, (6, 32), np.uint8)
    query = some(rng, int(rng.integers(0, 20)), pool)
    found = []
    for m in range(images):
        count = int(rng.integers(6, 12))
        here = (rng.random((count, 2)) * (89, 59)).astype(np.float32)
        there = (here + rng.normal(0, 1, here.shape) + (25, 3)).astype(np.float32)
        found.append(Aligned(m, some(rng, int(rng.integers(0, 20)), pool), here, there, SIZE, SIZE))
    return query, found


@settings(deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([3.0, 10.0, 200.0]), st.integers(0, 3))
def test_new_keypoints_are_what_the_loops_say(seed, radius, count):
    query, images = scene(seed, count)
    expected = [NONE] * len(query.xy)
    for one in images:
        at = one.to_map.at(query.xy)
        found = reference.nearest_word(query.descriptors, at, one.other.xy, one.other.descriptors, radius, NONE)
        expected = [min(pair) for pair in zip(expected, found, strict=True)]
    assert new_keypoints(query, images, radius).tolist() == expected


@settings(deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([3.0, 10.0, 200.0]))
def test_missing_words_are_those_that_should_be_in_view(seed, radius):
    query, [one] = scene(seed, 1)
    place, distance = missing_words(query, one, SIZE, radius)
    at = one.to_query.at(one.other.xy)
    inside = [i for i, (x, y) in enumerate(at.tolist()) if 0 <= x < SIZE[1] and 0 <= y < SIZE[0]]
    assert place.dtype == np.float32
    assert np.allclose(place, at[inside], atol=1e-4)
    assert (place < (SIZE[1], SIZE[0])).all()  # float32 rounds none out of the image
    words = one.other.descriptors[inside]
    assert distance.tolist() == reference.nearest_word(words, at[inside], query.xy, query.descriptors, radius, NONE)


def test_a_word_at_the_very_border_stays_inside():
    here = np.array([[10, 10], [80, 10], [10, 50], [80, 50], [40, 30], [45, 20]], np.float32)
    last = np.nextafter(np.float32(90), np.float32(0))
    other = Features(np.array([[last, 5]], np.float32), np.zeros((1, 32), np.uint8))
    one = Aligned(0, other, here, here, SIZE, SIZE)
    nothing = Features(np.zeros((0, 2), np.float32), np.zeros((0, 32), np.uint8))
    place, distance = missing_words(nothing, one, SIZE, 5.0)
    assert (place < (90, 60)).all()
    assert (distance == NONE).all()
