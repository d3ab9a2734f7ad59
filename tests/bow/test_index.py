import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdslam.bow.index import IDF_ONE, InvertedFile, ranks_of
from tests import reference


def scene(seed, images=6, words=9, keypoints=20, boxes=4):
    rng = np.random.default_rng(seed)
    map_words = [rng.integers(-1, words, rng.integers(0, 15)).astype(np.int32) for _ in range(images)]
    query = rng.integers(-1, words, keypoints).astype(np.int32)
    return map_words, words, query, rng.random((boxes, keypoints)) < 0.5


@given(st.integers(0, 10_000), st.sampled_from(["ibow", "tfidf", "binary"]))
def test_scores_equal_the_loops(seed, score):
    map_words, words, query, inside = scene(seed)
    expected = reference.scores([list(w) for w in map_words], list(query), inside, score, IDF_ONE)
    assert np.array_equal(InvertedFile(map_words, words).scores(query, inside, score), expected)


@given(st.integers(0, 10_000))
def test_order_of_keypoints_boxes_and_images_changes_nothing(seed):
    map_words, words, query, inside = scene(seed)
    rng = np.random.default_rng(seed + 1)
    k, j, m = (rng.permutation(n) for n in (len(query), len(inside), len(map_words)))
    plain = InvertedFile(map_words, words).scores(query, inside, "ibow")
    mixed = InvertedFile([map_words[i] for i in m], words).scores(query[k], inside[j][:, k], "ibow")
    assert np.array_equal(mixed, plain[j][:, m])


@given(
    st.lists(st.lists(st.integers(0, 3), min_size=5, max_size=5), min_size=1, max_size=4),
    st.sampled_from(["last", "next"]),
)
def test_ranks_equal_the_loops(scores, unretrieved):
    assert np.array_equal(ranks_of(np.array(scores), unretrieved), reference.ranks(scores, unretrieved))


def test_ties_share_the_best_rank_of_their_group():
    scores = np.array([[5, 7, 5, 0, 0]])
    assert ranks_of(scores, "next").tolist() == [[2, 1, 2, 4, 4]]
    assert ranks_of(scores, "last").tolist() == [[2, 1, 2, 5, 5]]


@pytest.mark.parametrize("keypoints", [0, 3])
def test_nothing_known_scores_zero(keypoints):
    index = InvertedFile([np.array([0, 1], np.int32), np.array([1], np.int32)], 2)
    scores = index.scores(np.full(keypoints, -1, np.int32), np.ones((2, keypoints), bool), "ibow")
    assert scores.tolist() == [[0, 0], [0, 0]]


def test_a_word_in_every_image_says_nothing():
    index = InvertedFile([np.array([0, 1], np.int32), np.array([0], np.int32)], 2)
    assert index.scores(np.array([0], np.int32), np.ones((1, 1), bool), "ibow").tolist() == [[0, 0]]
    assert index.scores(np.array([1], np.int32), np.ones((1, 1), bool), "ibow")[0, 0] == round(np.log(2) * IDF_ONE)
