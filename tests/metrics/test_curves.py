"""Oracle: scikit-learn, and loops over pairs of cells for the location-controlled AUROC."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fdslam.metrics import curves
from tests import reference
from tests.metrics.scenes import make, ranks_of, scenes, scenes_with_maps


def near(value, expected):
    return value is expected is None or value == pytest.approx(expected, rel=1e-12)


def figures(values, positive):
    order = np.argsort(-np.array(values, np.float32), kind="stable")
    curve = curves.thresholds(np.array(values, np.float32)[order], np.array(positive, dtype=bool)[order])
    return curves.auroc(curve), curves.average_precision(curve), curves.f1_max(curve)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.integers(-5, 5), st.booleans()), min_size=1, max_size=40))
def test_curves_match_scikit_learn(pairs):
    values, positive = zip(*pairs, strict=True)
    for value, expected in zip(figures(values, positive), reference.curve(values, positive), strict=True):
        assert near(value, expected)


def test_curves_of_many_cells_match_scikit_learn():
    rng = np.random.default_rng(0)
    values, positive = rng.normal(0, 100, 20_000).round(), rng.random(20_000) < 0.03
    values[positive] += 70
    for value, expected in zip(figures(values, positive), reference.curve(values, positive), strict=True):
        assert near(value, expected)


def test_constant_map():
    assert figures([7.0] * 8, [True] * 2 + [False] * 6) == (0.5, 0.25, 0.4)


def test_undefined():
    assert figures([], []) == (None, None, None)
    assert figures([1, 2], [False, False]) == (None, None, None)
    assert figures([1, 2], [True, True]) == (None, 1.0, 1.0)


def location_controlled(scene, loc):
    return curves.location_controlled_auroc(*curves.location_matrix(ranks_of(scene, loc), scene))


@settings(max_examples=60, deadline=None)
@given(scenes_with_maps(most=5))
def test_location_controlled_matches_loops(drawn):
    scene, loc = drawn
    assert near(location_controlled(scene, loc), reference.location_controlled(scene, loc))


@settings(max_examples=40, deadline=None)
@given(scenes(most=5), st.integers(0, 2**32))
def test_any_fixed_map_scores_exactly_half(scene, seed):
    fixed = np.random.default_rng(seed).normal(size=(6, 5)).astype(np.float32)
    loc = [fixed[: -(-h // 10), : -(-w // 10)] for h, w in zip(scene.heights, scene.widths, strict=True)]
    assert location_controlled(scene, loc) in (None, 0.5)


def test_location_controlled_sees_change_and_only_there():
    scene = make("abc", [(30, 30)] * 3, [[[0, 0, 20, 10]], [], []])
    loc = [np.zeros((3, 3), np.float32) for _ in "abc"]
    loc[0][0, 0], loc[1][2, 2], loc[2][0, 1] = 1, 5, 2
    # against b: 2 pairs won, 2 tied; against c: 1 won, 1 tied, 2 lost (1 > 0; 1 < 2; 0 = 0; 0 < 2)
    assert location_controlled(scene, loc) == (3 / 4 + 1.5 / 4) / 2


def test_location_controlled_undefined():
    loc = [np.zeros((3, 3), np.float32)] * 2
    assert location_controlled(make("ab", [(30, 30)] * 2, [[], []]), loc) is None
    assert location_controlled(make("ab", [(30, 30)] * 2, [[[0, 0, 9, 9]]] * 2), loc) is None
    assert location_controlled(make("ab", [(30, 30)] * 2, [[[50, 0, 60, 9]], []]), loc) is None
    other_size = make("ab", [(30, 30), (30, 40)], [[[0, 0, 9, 9]], []])
    assert location_controlled(other_size, [loc[0], np.zeros((3, 4))]) is None
