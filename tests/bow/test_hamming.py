import faiss
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdslam.bow import hamming
from tests import reference


def descriptors(seed, count):
    """Half of them near copies of a few, so that equal distances and distance 0 happen."""
    rng = np.random.default_rng(seed)
    few = rng.integers(0, 256, (4, 32), dtype=np.uint8)
    copies = few[rng.integers(0, 4, count)] ^ (rng.random((count, 32)) < 0.03).astype(np.uint8)
    return np.where(rng.random((count, 1)) < 0.5, copies, rng.integers(0, 256, (count, 32), dtype=np.uint8))


@pytest.fixture(params=["compiled", "numpy"])
def path(request, monkeypatch):
    monkeypatch.setattr(hamming, "NATIVE", request.param == "compiled")


def loops(queries, words):
    return [sorted((reference.hamming(q, w), i) for i, w in enumerate(words)) for q in queries]


@pytest.mark.usefixtures("path")
@given(st.integers(0, 10_000))
def test_ids_in_the_interval_of_a_query_are_passed_over(seed):
    queries, words = descriptors(seed, 5), descriptors(seed + 1, 20)
    leave = np.sort(np.random.default_rng(seed).integers(0, 21, (5, 2)), axis=1).astype(np.int32)
    names = np.arange(100, 120, dtype=np.int32)
    keys = hamming.two_nearest_keys(*hamming.pack(words, names), queries, leave + 100)
    for row, ordered, (begin, end) in zip(keys, loops(queries, words), leave, strict=True):
        expected = [(d, i + 100) for d, i in ordered if not begin <= i < end][:2]
        found = zip(hamming.distance_of(row).tolist(), hamming.id_of(row).tolist(), strict=True)
        assert [pair for pair in found if pair[1] >= 0] == expected


@pytest.mark.usefixtures("path")
@pytest.mark.parametrize("count", [0, 1, 2, 7, 8, 9, 40])
def test_two_nearest_are_those_of_the_loops(count):
    queries, words = descriptors(count, 5), descriptors(count + 100, count)
    distance, index = hamming.two_nearest(queries, words)
    for i, ordered in enumerate(loops(queries, words)):
        known = ordered[:2]
        assert list(zip(distance[i, : len(known)], index[i, : len(known)], strict=True)) == known
        assert (index[i, len(known) :] == -1).all()
        assert (distance[i, len(known) :] > 256).all()


@given(st.integers(0, 1000), st.integers(0, 70))
def test_pack_and_unpack_are_inverse(seed, count):
    words = descriptors(seed, count)
    groups, ids = hamming.pack(words)
    assert np.array_equal(hamming.unpack(groups)[ids >= 0], words)
    assert ids[ids >= 0].tolist() == list(range(count))


@pytest.mark.usefixtures("path")
def test_many_tiles_against_an_independent_library():
    queries, words = descriptors(1, 50), descriptors(2, 3000)
    index = faiss.IndexBinaryFlat(256)
    index.add(words)
    expected, _ = index.search(queries, 2)
    distance, found = hamming.two_nearest(queries, words)
    assert np.array_equal(distance, expected)
    assert [[reference.hamming(q, words[i]) for i in row] for q, row in zip(queries, found, strict=True)] == (
        expected.tolist()
    )
