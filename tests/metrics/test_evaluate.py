"""The whole row: against the loops, and what must not change it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fdslam.config import Evaluation
from fdslam.metrics import Figure, Scene, bootstrap, evaluate
from tests import reference
from tests.metrics.scenes import make, permuted, scenes_with_maps, ties
from tests.metrics.test_bootstrap import larger_scene, percent

X = [20, 10, 50]  # not sorted on purpose
CRITERIA = ("coverage", "iou")


def config(criterion="coverage", **fields):
    return Evaluation(**{"X": X, "bootstrap": 10, "criterion": criterion, "found": 0.25} | fields)


def same(one, two):
    """Whether two rows are equal to the last bit."""
    fields = ("pooled", "per_query", "auroc", "lc_auroc", "ap", "f1_max")
    return all(getattr(one, f) == getattr(two, f) for f in fields) and one.grades.tolist() == two.grades.tolist()


@settings(max_examples=40, deadline=None)
@given(scenes_with_maps(most=5), st.sampled_from(CRITERIA))
def test_values_match_loops(drawn, criterion):
    scene, loc = drawn
    row = evaluate("FD", loc, scene, config(criterion), 0)
    found = reference.found_by_coverage if criterion == "coverage" else reference.found_by_iou
    once, key = [1] * len(loc), ties(scene, 0)
    hits = {}
    for pool, figures in (("all", row.pooled), ("query", row.per_query)):
        assert list(figures) == [10, 20, 50]
        for x, figure in figures.items():
            hits[pool, x] = found(scene, reference.selected_cells(scene, loc, key, x, pool), 0.25)
            assert (figure.value if figure else None) == pytest.approx(percent(hits[pool, x], once, scene))
    table = np.array([hits["all", x] for x in (10, 20, 50)]).reshape(3, -1)
    assert row.grades.tolist() == [next((i for i in range(3) if table[i, o]), 3) for o in range(table.shape[1])]
    expected = (*reference.curve(*reference.cells_and_truth(scene, loc)), reference.location_controlled(scene, loc))
    for figure, e in zip((row.auroc, row.ap, row.f1_max, row.lc_auroc), expected, strict=True):
        assert (figure.value if figure else None) == pytest.approx(e)


@pytest.mark.parametrize("criterion", CRITERIA)
def test_intervals_match_literal_resampling(criterion):
    scene, loc = larger_scene()
    row = evaluate("FD", loc, scene, config(criterion, bootstrap=12, confidence=0.8), 5)
    found = reference.found_by_coverage if criterion == "coverage" else reference.found_by_iou
    pooled, within, others = {x: [] for x in row.pooled}, {x: [] for x in row.pooled}, []
    own = {x: found(scene, reference.selected_cells(scene, loc, ties(scene, 5), x, "query"), 0.25) for x in row.pooled}
    for times in bootstrap.resample([f"{i:02d}" for i in range(12)], 12, 5).tolist():  # the names are sorted as listed
        for x in row.pooled:
            chosen = reference.selected_cells(scene, loc, ties(scene, 5), x, "all", times)
            pooled[x].append(percent(found(scene, chosen, 0.25), times, scene))
            within[x].append(percent(own[x], times, scene))
        curve = reference.curve(*reference.cells_and_truth(scene, loc, times))
        others.append((*curve, reference.location_controlled(scene, loc, times)))
    for pool, figures, replicates in (("all", row.pooled, pooled), ("query", row.per_query, within)):
        for x, figure in figures.items():
            chosen = reference.selected_cells(scene, loc, ties(scene, 5), x, pool)
            assert figure.value == pytest.approx(percent(found(scene, chosen, 0.25), [1] * 12, scene))
            assert (figure.low, figure.high) == pytest.approx(tuple(np.quantile(replicates[x], [0.1, 0.9])))
    figures = (row.auroc, row.ap, row.f1_max, row.lc_auroc)
    for figure, replicates in zip(figures, zip(*others, strict=True), strict=True):
        assert (figure.low, figure.high) == pytest.approx(tuple(np.quantile(replicates, [0.1, 0.9])))
        assert figure.low < figure.value < figure.high


@settings(max_examples=30, deadline=None)
@given(scenes_with_maps(most=5), st.sampled_from(CRITERIA), st.randoms(use_true_random=False))
def test_order_of_queries_and_boxes_changes_nothing(drawn, criterion, random):
    scene, loc = drawn
    one = evaluate("FD", loc, scene, config(criterion), 0)
    order = random.sample(range(len(loc)), len(loc))
    within = [random.sample(range(len(b)), len(b)) for b in scene.boxes]
    shuffled = tuple(boxes[w] for boxes, w in zip(scene.boxes, within, strict=True))
    other = permuted(Scene(scene.names, scene.heights, scene.widths, shuffled), order)
    two = evaluate("FD", [loc[i] for i in order], other, config(criterion), 0)
    start = np.cumsum([0, *(len(b) for b in scene.boxes)])
    back = [start[q] + i for q in order for i in within[q]]
    assert two.grades.tolist() == one.grades[back].tolist()
    two.grades[:] = 0
    one.grades[:] = 0
    assert same(one, two)


@settings(max_examples=20, deadline=None)
@given(scenes_with_maps(), st.sampled_from(CRITERIA))
def test_only_the_order_of_the_values_matters(drawn, criterion):
    scene, loc = drawn
    one = evaluate("FD", loc, scene, config(criterion), 0)
    other = [np.sqrt(cells.astype(np.float64)) - 7 for cells in loc]
    assert same(one, evaluate("FD", other, scene, config(criterion), 0))


def test_seed_decides_and_nothing_else_is_random():
    scene, loc = larger_scene()
    rows = [evaluate("FD", loc, scene, config(), seed) for seed in (1, 1, 2)]
    assert same(rows[0], rows[1])
    assert rows[0].auroc.value == rows[2].auroc.value
    assert rows[0].auroc.low != rows[2].auroc.low


def test_no_boxes():
    scene = make("ab", [(30, 30)] * 2, [[], []])
    row = evaluate("FD", [np.zeros((3, 3), np.float32)] * 2, scene, config(), 0)
    assert row.pooled == row.per_query == {10: None, 20: None, 50: None}
    assert row.auroc is row.lc_auroc is row.ap is row.f1_max is None
    assert row.grades.shape == (0,)


def test_no_queries():
    row = evaluate("FD", [], Scene((), (), (), ()), config(), 0)
    assert row.pooled == {10: None, 20: None, 50: None}
    assert row.auroc is None


@pytest.mark.parametrize("criterion", CRITERIA)
def test_one_query(criterion):
    """Resampling one query gives that query: every interval is a point."""
    scene = make("a", [(30, 30)], [[[0, 0, 10, 10], [90, 90, 99, 99]]])
    loc = [np.arange(9, 0, -1, dtype=np.float32).reshape(3, 3)]
    row = evaluate("FD", loc, scene, config(criterion), 0)
    assert row.pooled == {10: Figure(0, 0, 0), 20: Figure(50, 50, 50), 50: Figure(50, 50, 50)}  # K = 0, 1, 4
    assert row.per_query == row.pooled
    assert row.auroc == row.ap == row.f1_max == Figure(1, 1, 1)
    assert row.lc_auroc is None
    assert row.grades.tolist() == [1, 3]


def test_every_cell_positive():
    scene = make("ab", [(30, 30)] * 2, [[[0, 0, 30, 30]]] * 2)
    row = evaluate("FD", [np.zeros((3, 3), np.float32)] * 2, scene, config(), 0)
    assert row.auroc is row.lc_auroc is None
    assert row.ap == row.f1_max == Figure(1, 1, 1)


def test_a_fixed_map_has_location_controlled_half_in_every_replicate():
    scene, loc = larger_scene()
    row = evaluate("blob", [loc[0]] * 12, scene, config(), 0)
    assert row.lc_auroc == Figure(0.5, 0.5, 0.5)
