"""Oracle: explicit loops over sorted cells, boxes painted in pixels, connected components of pixels."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import rankdata

from fdslam.metrics import accuracy
from fdslam.metrics.accuracy import cut, needed_positions, prefix_counts, rank_cells
from tests import reference
from tests.metrics.scenes import make, permuted, scenes_with_maps, ties


def in_listed_order(scene, found):
    """From the scene's own order of objects to the order in which they were given."""
    result = np.empty(len(found), dtype=bool)
    result[scene.objects.listed] = found
    return result.tolist()


@settings(max_examples=60, deadline=None)
@given(scenes_with_maps(), st.sampled_from([0.25, 0.5, 1.0]), st.sampled_from([5, 10, 20, 50, 100]), st.integers(0, 3))
def test_coverage_matches_loops(drawn, share, percent, seed):
    scene, loc = drawn
    ranking = rank_cells(scene.flatten("map", loc), scene, seed)
    for pool, place in (("all", ranking.position), ("query", ranking.within)):
        sizes = len(place) if pool == "all" else scene.sizes[scene.objects.query]
        found = needed_positions(place, scene, share) <= cut(sizes, percent)
        chosen = reference.selected_cells(scene, loc, ties(scene, seed), percent, pool)
        assert in_listed_order(scene, found) == reference.found_by_coverage(scene, chosen, share)


@settings(max_examples=60, deadline=None)
@given(scenes_with_maps(), st.sampled_from([0.1, 0.25, 0.5]), st.sampled_from([5, 10, 20, 50, 100]))
def test_iou_matches_labelled_pixels(drawn, share, percent):
    scene, loc = drawn
    ranking = rank_cells(scene.flatten("map", loc), scene, 0)
    found = accuracy.found_by_iou(ranking.within, cut(scene.sizes, percent)[None], scene, share)[0]
    chosen = reference.selected_cells(scene, loc, ties(scene, 0), percent, "query")
    assert in_listed_order(scene, found) == reference.found_by_iou(scene, chosen, share)


def test_iou_joins_cells_across_corners():
    scene = make("a", [(30, 30)], [[[0, 0, 20, 20]]])
    within = np.array([1, 9, 8, 7, 2, 6, 5, 4, 3])  # the diagonal first
    selected = np.array([[1], [2], [3]])
    assert accuracy.found_by_iou(within, selected, scene, 0.5)[:, 0].tolist() == [False, True, False]  # ¼, ½, 2/5


def test_exactly_half_is_found():
    scene = make("a", [(30, 30)], [[[0, 0, 20, 10], [0, 10, 20.01, 20], [10.1, 20.3, 29.9, 20.4]]])
    needed = needed_positions(np.arange(1, 10), scene, 0.5)
    assert needed[scene.objects.listed.argsort()].tolist() == [1, 5, 8]


def test_a_box_outside_is_never_found():
    scene = make("a", [(30, 30)], [[[40, 0, 50, 10], [5, 5, 5, 5], [0, 0, 10, 10]]])
    needed = needed_positions(np.arange(1, 10), scene, 0.0)
    assert sorted(needed.tolist()) == [0, 10, 10]
    assert (needed_positions(np.arange(1, 10), scene, 0.5) <= 9).sum() == 1
    assert accuracy.found_by_iou(np.arange(1, 10), np.array([[9]]), scene, 0.0).sum() == 1


@given(st.integers(0, 10**9), st.integers(1, 100))
def test_cut_is_exact(cells, percent):
    assert cut(cells, percent) == int(Fraction(percent, 100) * cells)


def test_nothing_is_selected_below_one_cell():
    assert cut(19, 5) == 0
    assert cut(20, 5) == 1


@given(st.lists(st.integers(0, 3), max_size=30), st.data())
def test_prefix_counts(query, data):
    cuts = sorted(data.draw(st.lists(st.integers(0, len(query)), max_size=5)))
    expected = [[query[:k].count(q) for q in range(4)] for k in cuts]
    assert prefix_counts(np.array(query, dtype=int), np.array(cuts, dtype=int), 4).tolist() == expected


@settings(max_examples=40, deadline=None)
@given(scenes_with_maps(), st.randoms(use_true_random=False))
def test_order_of_queries_changes_no_place(drawn, random):
    scene, loc = drawn
    order = random.sample(range(len(loc)), len(loc))
    other = permuted(scene, order)
    one = rank_cells(scene.flatten("map", loc), scene, 0)
    two = rank_cells(other.flatten("map", [loc[i] for i in order]), other, 0)
    np.testing.assert_array_equal(one.position, two.position)
    np.testing.assert_array_equal(one.within, two.within)


def test_ties_are_random_seeded_and_independent_of_other_queries():
    sizes = [(200, 200)] * 3
    scene, loc = make("abc", sizes, [[]] * 3), [np.zeros((20, 20), np.float32)] * 3
    ranking = rank_cells(scene.flatten("map", loc), scene, 7)
    rows = np.arange(1200) % 400 // 20
    top = rows[ranking.order[:240]]
    assert abs(top.mean() - 9.5) < 1.5  # neither the upper rows first nor the lower
    assert set(scene.query_of[ranking.order[:240]]) == {0, 1, 2}
    assert not np.array_equal(ranking.order, rank_cells(scene.flatten("map", loc), scene, 8).order)
    alone = make("b", sizes[:1], [[]])
    np.testing.assert_array_equal(rank_cells(alone.flatten("map", loc[:1]), alone, 7).within, ranking.within[400:800])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_largest_values_come_first(dtype):
    scene = make("ab", [(10, 20), (10, 20)], [[], []])
    loc = [np.array([[3, -np.inf]], dtype), np.array([[np.inf, 4]], dtype)]
    ranking = rank_cells(scene.flatten("map", loc), scene, 0)
    assert ranking.order.tolist() == [2, 3, 0, 1]
    assert ranking.position.tolist() == [3, 4, 1, 2]
    assert ranking.within.tolist() == [1, 2, 1, 2]


@settings(max_examples=40, deadline=None)
@given(scenes_with_maps(), st.integers(0, 3))
def test_equal_cells_have_equal_ranks(drawn, seed):
    scene, loc = drawn
    values = scene.flatten("map", loc)
    ranking = rank_cells(values, scene, seed)
    assert np.array_equal(ranking.tied(values[ranking.order]), rankdata(values, method="max"))
