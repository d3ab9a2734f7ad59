from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdslam.bow.index import IDF_ONE, MOST, InvertedFile
from fdslam.bow.lists import ranks_of
from fdslam.config import Orb
from fdslam.errors import InputError
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


@pytest.mark.parametrize("keypoints", [0, 3])
def test_nothing_known_scores_zero(keypoints):
    index = InvertedFile([np.array([0, 1], np.int32), np.array([1], np.int32)], 2)
    scores = index.scores(np.full(keypoints, -1, np.int32), np.ones((2, keypoints), bool), "ibow")
    assert scores.tolist() == [[0, 0], [0, 0]]


def test_a_word_in_every_image_says_nothing():
    index = InvertedFile([np.array([0, 1], np.int32), np.array([0], np.int32)], 2)
    assert index.scores(np.array([0], np.int32), np.ones((1, 1), bool), "ibow").tolist() == [[0, 0]]
    assert index.scores(np.array([1], np.int32), np.ones((1, 1), bool), "ibow")[0, 0] == round(np.log(2) * IDF_ONE)


@given(st.integers(0, 10_000), st.lists(st.integers(0, 6), max_size=5))
def test_adding_image_by_image_is_indexing_at_once(seed, cuts):
    map_words, words, query, inside = scene(seed)
    at_once = InvertedFile(map_words, words).scores(query, inside, "ibow")
    grown = InvertedFile([], 0)
    bounds = [0, *sorted(cuts), 6]
    for begin, end in pairwise(bounds):
        known = max((int(w.max(initial=-1)) for w in map_words[:end]), default=-1) + 1  # the vocabulary grows too
        grown.add(map_words[begin:end], known)
    grown.add([], words)
    assert np.array_equal(grown.scores(query, inside, "ibow"), at_once)


@given(st.integers(0, 10_000), st.sets(st.integers(0, 5)), st.booleans())
def test_a_removed_session_leaves_the_index_of_the_rest(seed, gone, one_by_one):
    map_words, words, query, inside = scene(seed)
    index = InvertedFile([] if one_by_one else map_words, words)
    for each in map_words if one_by_one else []:
        index.add([each], words)
    index.remove(np.array(sorted(gone), np.int64))
    rest = [w for m, w in enumerate(map_words) if m not in gone]
    assert index.images == len(rest)
    expected = reference.scores([list(w) for w in rest], list(query), inside, "ibow", IDF_ONE)
    assert np.array_equal(index.scores(query, inside, "ibow"), expected)
    index.add([map_words[0]], words)
    again = reference.scores([list(w) for w in [*rest, map_words[0]]], list(query), inside, "ibow", IDF_ONE)
    assert np.array_equal(index.scores(query, inside, "ibow"), again)


@given(st.integers(0, 10_000), st.sampled_from([2, 3, 7]), st.sampled_from(["last", "next"]))
def test_splitting_storing_and_batches_change_no_rank(seed, parts, unretrieved):
    map_words, words, query, inside = scene(seed)
    dense = reference.scores([list(w) for w in map_words], list(query), inside, "ibow", IDF_ONE)
    expected = reference.ranks(dense, unretrieved)
    index = InvertedFile(map_words[:4], words)
    index.add(map_words[4:], words)
    split = np.concatenate([part.scores(query, inside, "ibow") for part in index.split(parts)], axis=1)
    assert np.array_equal(ranks_of(split, unretrieved), expected)
    other, where = query[::-1].copy(), inside[:2]
    batch = index.batch_scores([(other, where), (query, inside), (query[:0], inside[:1, :0])], "ibow")
    assert np.array_equal(batch[:2], index.scores(other, where, "ibow"))
    assert np.array_equal(ranks_of(batch[2:-1], unretrieved), expected)
    assert not batch[-1].any()
    arrays = index.arrays()
    for array in arrays.values():
        array.flags.writeable = False  # as if mapped from a file
    stored = InvertedFile.from_arrays(arrays)
    assert np.array_equal(ranks_of(stored.scores(query, inside, "ibow"), unretrieved), expected)
    stored.add(map_words, words)
    index.add(map_words, words)
    assert np.array_equal(stored.scores(query, inside, "tfidf"), index.scores(query, inside, "tfidf"))


def test_a_word_more_often_than_a_byte_holds():
    index = InvertedFile([np.zeros(300, np.int32), np.array([1], np.int32)], 2)
    assert index.scores(np.array([0], np.int32), np.ones((1, 1), bool), "ibow")[0].tolist() == [
        300 * round(np.log(2) * IDF_ONE),
        0,
    ]


def test_parts_do_not_change_with_the_whole_nor_by_themselves():
    map_words, words, query, inside = scene(3)
    index = InvertedFile(map_words, words)
    parts = index.split(2)
    before = [part.scores(query, inside, "ibow") for part in parts]
    stored = [InvertedFile.from_arrays(part.arrays()) for part in parts]
    for _ in range(6):
        index.add([map_words[0]], words)
    index.remove(np.array([0, 1]))
    for part, again, scores in zip(parts, stored, before, strict=True):
        assert np.array_equal(part.scores(query, inside, "ibow"), scores)
        assert np.array_equal(again.scores(query, inside, "ibow"), scores)
        for change in (lambda p=part: p.add([map_words[0]], words), lambda p=again: p.remove(np.array([0]))):
            with pytest.raises(ValueError, match="a part of a map does not change"):
                change()


def test_what_scores_cannot_hold_is_refused_and_the_most_they_hold_is_exact():
    many = np.zeros(MOST, np.int32)
    index = InvertedFile([many, np.array([1], np.int32)], 2)
    exact = MOST**3 * round(np.log(2) * IDF_ONE)
    assert index.scores(many, np.ones((1, MOST), bool), "ibow")[0].tolist() == [exact, 0]
    assert MOST**3 * round(np.log(1e6) * IDF_ONE) < 2**63
    assert Orb.__dataclass_fields__["features"].metadata["high"] == MOST
    more = np.zeros(MOST + 1, np.int32)
    for refused in (lambda: index.add([more], 2), lambda: index.scores(more, np.ones((1, MOST + 1), bool), "ibow")):
        with pytest.raises(InputError, match=r"20001 keypoints: scores hold at most 20000; .*bow\.features"):
            refused()


def test_no_queries_and_no_such_image():
    index = InvertedFile([np.array([0], np.int32)], 1)
    assert index.batch_scores([], "ibow").shape == (0, 1)
    for image in (-1, 1):
        with pytest.raises(IndexError, match="there are 1"):
            index.remove(np.array([image]))
