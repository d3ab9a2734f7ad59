import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fdslam.bow.index import InvertedFile
from fdslam.config import Retrieval
from fdslam.localization import keypoints_inside, localize, strong_list
from fdslam.types import Boxes, Features
from tests import reference

RANKS = st.lists(st.lists(st.integers(1, 6), min_size=6, max_size=6), min_size=1, max_size=8)


@given(RANKS)
def test_strong_list_equals_exact_fractions(ranks):
    assert strong_list(np.array(ranks, np.int32)).tolist() == reference.strong_list(ranks)


def test_equal_sums_of_different_ranks_go_by_map_id():
    assert strong_list(np.array([[3, 2], [3, 3], [3, 6]], np.int32)).tolist() == [0, 1]
    rng = np.random.default_rng(0)
    for _ in range(20):
        ranks = rng.integers(1, 165, (19, 164)).astype(np.int32)
        assert strong_list(ranks).tolist() == reference.strong_list(ranks)


@given(RANKS, st.randoms())
def test_order_of_obbs_changes_nothing(ranks, random):
    mixed = random.sample(ranks, len(ranks))
    assert np.array_equal(strong_list(np.array(ranks, np.int32)), strong_list(np.array(mixed, np.int32)))


def test_equal_relevance_goes_by_map_id():
    assert strong_list(np.array([[2, 1, 2, 1]], np.int32)).tolist() == [1, 3, 0, 2]


def test_boxes_are_half_open():
    boxes = np.array([[10, 10, 20, 20]], np.float32)
    xy = np.array([[10, 10], [19.999, 15], [20, 15], [9.999, 15], [15, 20]], np.float32)
    assert keypoints_inside(boxes, xy).tolist() == [[True, True, False, False, False]]


def query(min_keypoints, words):
    index = InvertedFile([np.array([0, 1], np.int32), np.array([1, 2], np.int32), np.array([2, 2], np.int32)], 3)
    xy = np.array([[1, 1], [2, 2], [8, 8]], np.float32)
    boxes = Boxes(np.array([[0, 0, 5, 5], [5, 5, 10, 10], [20, 20, 30, 30]], np.float32), ("a", "b", "c"))
    features = Features(xy, np.zeros((3, 32), np.uint8))
    return localize(index, boxes, features, np.array(words, np.int32), Retrieval(min_keypoints=min_keypoints), {}.get)


def test_an_obb_without_enough_keypoints_says_nothing():
    assert query(1, [0, 1, 2]).boxes.source == ("a", "b")
    assert query(2, [0, 1, 2]).boxes.source == ("a",)
    nothing = query(3, [0, 1, 2])
    assert nothing.ranks.shape == (0, 3)
    assert nothing.strong.tolist() == [0, 1, 2]


def test_ranks_of_a_small_map_by_hand():
    # Box a holds words 0 and 1: image 0 has both, image 1 has word 1. Box b holds word 2, twice in image 2.
    found = query(1, [0, 1, 2])
    assert found.ranks.tolist() == [[1, 2, 3], [3, 2, 1]]
    assert found.strong.tolist() == [0, 2, 1]


def test_an_obb_whose_words_are_unknown_ranks_every_image_last():
    assert query(1, [-1, -1, 2]).ranks.tolist() == [[3, 3, 3], [3, 2, 1]]
