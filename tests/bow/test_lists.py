import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fdslam.bow.lists import first_images, ranks_of, ranks_of_images
from tests import reference

SCORES = st.lists(st.lists(st.integers(0, 3), min_size=5, max_size=5), min_size=1, max_size=4)
UNRETRIEVED = st.sampled_from(["last", "next"])


@given(SCORES, UNRETRIEVED)
def test_ranks_equal_the_loops(scores, unretrieved):
    assert np.array_equal(ranks_of(np.array(scores), unretrieved), reference.ranks(scores, unretrieved))


def test_ties_share_the_best_rank_of_their_group():
    scores = np.array([[5, 7, 5, 0, 0]])
    assert ranks_of(scores, "next").tolist() == [[2, 1, 2, 4, 4]]
    assert ranks_of(scores, "last").tolist() == [[2, 1, 2, 5, 5]]


@given(SCORES, UNRETRIEVED, st.lists(st.integers(0, 4), max_size=6))
def test_ranks_of_a_few_images_are_those_of_the_full_lists(scores, unretrieved, images):
    images = np.array(images, np.int64)
    few = ranks_of_images(np.array(scores), images, unretrieved)
    assert np.array_equal(few, reference.ranks(scores, unretrieved)[:, images])


@given(SCORES, st.integers(0, 7))
def test_first_images_are_those_of_a_full_sort(scores, n):
    expected = [sorted(range(5), key=lambda m: (-row[m], m))[:n] for row in scores]
    assert first_images(np.array(scores), n).tolist() == expected


def test_no_list_and_no_image():
    assert ranks_of(np.zeros((0, 4), np.int64), "last").shape == (0, 4)
    assert ranks_of(np.zeros((2, 0), np.int64), "next").shape == (2, 0)
    assert first_images(np.zeros((2, 0), np.int64), 3).shape == (2, 0)
