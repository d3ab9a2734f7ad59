import numpy as np
import pytest

from fdslam.bow import hamming, pivots
from fdslam.bow.pivots import HUB_DEPTH, Pivots
from tests import reference
from tests.bow.test_hamming import descriptors


@pytest.fixture(params=["compiled", "numpy"])
def path(request, monkeypatch):
    for place in (hamming, pivots):
        monkeypatch.setattr(place, "NATIVE", request.param == "compiled")


def per_place(query, groups, ids, positions, depth):
    """(distance, id) of the ``depth`` nearest in each of the eight places of a group, by loops."""
    rows, found = hamming.unpack(groups), []
    for lane in range(8):
        mine = [p for p in positions if p % 8 == lane and ids[p] >= 0]
        found += sorted((reference.hamming(query, rows[p]), int(ids[p])) for p in mine)[:depth]
    return found


def nearest_by_loops(found, query, depth):
    hubs = per_place(query, found.hubs, found.hub_ids, range(len(found.hub_ids)), HUB_DEPTH)
    visited = [p for _, hub in hubs for p in range(8 * found.begins[hub], 8 * found.begins[hub + 1])]
    return per_place(query, found.groups, found.ids, visited, depth)


@pytest.mark.usefixtures("path")
@pytest.mark.parametrize("depth", [1, 2, 4, 8])
@pytest.mark.parametrize("count", [1, 9, 700])
def test_nearest_are_those_of_the_loops(depth, count):
    rng = np.random.default_rng(depth)
    found = Pivots.around(rng.integers(0, 256, (count, 32), dtype=np.uint8), 0)
    queries = descriptors(depth, 4)
    keys = found.nearest(queries, depth)
    assert (keys[:, :-1] <= keys[:, 1:]).all()
    for query, row in zip(queries, keys, strict=True):
        pairs = zip(hamming.distance_of(row).T.ravel(), hamming.id_of(row).T.ravel(), strict=True)
        assert [pair for pair in pairs if pair[1] >= 0] == nearest_by_loops(found, query, depth)
    homes = [min(nearest_by_loops(found, query, 1))[1] for query in queries]
    assert found.home(queries).tolist() == homes


def test_every_pivot_lies_with_its_nearest_hub():
    chosen = descriptors(3, 300)
    found = Pivots.around(chosen, 0)
    hubs = hamming.unpack(found.hubs)[found.hub_ids >= 0]
    assert len(found) == 300
    assert len(hubs) == 40  # 2 · √300, in whole groups
    rows = hamming.unpack(found.groups)
    for hub, (begin, end) in enumerate(zip(found.begins[:-1], found.begins[1:], strict=True)):
        for place in range(8 * begin, 8 * end):
            if found.ids[place] >= 0:
                assert np.array_equal(rows[place], chosen[found.ids[place]])
                assert hub == min((reference.hamming(rows[place], h), i) for i, h in enumerate(hubs))[1]


@pytest.mark.usefixtures("path")
def test_pivots_move_to_the_majority_of_what_is_around_them():
    words = np.zeros((7, 32), np.uint8)
    words[:3, 0], words[3:, 0] = [0b11100000, 0b11000000, 0b10100001], [0b00011000, 0b00011110, 0b00011000, 0b11011110]
    moved = pivots._moved(words[[0, 3]], words, lambda _, rows: np.array([0, 0, 0, 1, 1, 1, 1]))
    # Of the first three the upper bits have a majority; of the last four bits 1 and 2 (from the left) are set twice of
    # four where the centre has them: a draw, as in bits 5 and 6.
    assert moved[:, 0].tolist() == [0b11100000, 0b00011000]
    assert pivots._moved(words[[0]], words[:0], lambda _, rows: np.zeros(0, np.int64)).tolist() == words[[0]].tolist()


def test_the_choice_is_the_same_on_both_paths_and_grows_with_the_words(monkeypatch):
    words = np.unique(descriptors(1, 1500), axis=0)
    monkeypatch.setattr(pivots, "WORDS_PER_PIVOT", 8)
    native = Pivots.choose(words)
    for place in (hamming, pivots):
        monkeypatch.setattr(place, "NATIVE", False)
    slow = Pivots.choose(words)
    assert len(native) == len(words) // 8
    assert native.words == len(words)
    for name, array in native.arrays().items():
        assert np.array_equal(array, slow.arrays()[name]), name
    again = Pivots.from_arrays(native.arrays())
    assert np.array_equal(again.nearest(words, 2), native.nearest(words, 2))
    assert again.nbytes == native.nbytes > 32 * len(native)


def test_kernels_visit_as_many_hubs():
    kernels = pytest.importorskip("fdslam.bow.kernels", reason="without numba there are no kernels")
    assert kernels.HUB_DEPTH == HUB_DEPTH
    assert kernels.NONE == hamming.NONE
