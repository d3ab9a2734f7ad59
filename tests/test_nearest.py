"""Oracle: reference (every pair of descriptors)."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fdslam import nearest
from fdslam.nearest import FARTHEST, nearest_distance
from tests import reference


def descriptors(rng, n):
    """Like SIFT's: whole numbers, few of them large, norm about 512."""
    d = rng.exponential(size=(n, 128)) ** 1.5
    return np.round(512 * d / np.linalg.norm(d, axis=1, keepdims=True)).clip(0, 255).astype(np.uint8)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(0, 12), st.lists(st.integers(0, 12), max_size=4), st.integers(1, 9))
def test_nearest_against_all_pairs(seed, n, sizes, block):
    rng = np.random.default_rng(seed)
    query, maps = descriptors(rng, n), [descriptors(rng, m) for m in sizes]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(nearest, "BLOCK", block)
        ours = nearest_distance(query, maps)
    assert ours.dtype == np.float32
    assert ours.shape == (n,)
    oracle = np.array(reference.nearest_distance(query, maps))
    np.testing.assert_allclose(ours, np.where(np.isinf(oracle), FARTHEST, oracle), rtol=1e-6)


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("block", [1, 7, 64, 512])
def test_every_bit_is_that_of_whole_numbers(monkeypatch, threads, block):
    # The largest values that uint8 can hold, too: all sums still have to be exact.
    rng = np.random.default_rng(4)
    query = np.concatenate([descriptors(rng, 50), np.full((1, 128), 255), rng.choice([0, 255], (30, 128))])
    maps = [descriptors(rng, 200), rng.choice([0, 255, 254], (90, 128)), descriptors(rng, 1)]
    query, maps = query.astype(np.uint8), [m.astype(np.uint8) for m in maps]
    difference = query.astype(np.int64)[:, None] - np.concatenate(maps).astype(np.int64)[None]
    exact = np.sqrt((difference**2).sum(axis=2).min(axis=1)).astype(np.float32)
    monkeypatch.setattr(nearest, "BLOCK", block)
    np.testing.assert_array_equal(nearest_distance(query, maps, threads), exact)


@pytest.mark.parametrize("bad", [np.zeros((3, 128), np.float32), np.zeros((3, 64), np.uint8), np.zeros(128, np.uint8)])
def test_bad_descriptors(bad):
    good = np.zeros((2, 128), np.uint8)
    for query, maps in ((bad, [good]), (good, [good, bad])):
        with pytest.raises(ValueError, match=r"uint8 \[n, 128\] is needed"):
            nearest_distance(query, maps)


def test_the_same_descriptor_is_at_exactly_0():
    rng = np.random.default_rng(1)
    query = descriptors(rng, 60)
    neighbour = query.copy()
    neighbour[:, 0] ^= 1  # a distance of 1 beside norms of 512: lost where squares cancel
    assert (nearest_distance(query, [neighbour]) == 1).all()
    assert (nearest_distance(query, [neighbour, query[::-1]]) == 0).all()


def test_order_never_matters():
    rng = np.random.default_rng(2)
    query, maps = descriptors(rng, 300), [descriptors(rng, m) for m in (200, 0, 400, 7)]
    expected = nearest_distance(query, maps)
    np.testing.assert_array_equal(nearest_distance(query, maps[::-1]), expected)
    np.testing.assert_array_equal(nearest_distance(query, [rng.permutation(np.concatenate(maps))]), expected)
    order = rng.permutation(len(query))
    np.testing.assert_array_equal(nearest_distance(query[order], maps), expected[order])


@pytest.mark.parametrize("maps", [[], [np.empty((0, 128), np.uint8)], [np.empty((0, 128), np.uint8)] * 3])
def test_no_map_features(maps):
    rng = np.random.default_rng(3)
    query = descriptors(rng, 5)
    np.testing.assert_array_equal(nearest_distance(query, maps), np.full(5, np.float32(FARTHEST)))
    assert nearest_distance(query[:0], maps).shape == (0,)


def test_nothing_is_farther_than_farthest():
    a, b = np.zeros((2, 1, 128), np.uint8)
    a[0, :64], b[0, 64:] = 64, 64  # norm 512, nothing in common
    assert 724 < nearest_distance(a, [b])[0] <= FARTHEST < 735
