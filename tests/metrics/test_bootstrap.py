"""Oracle: literal resampling: the drawn queries are copied and everything is computed again."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fdslam.metrics import Figure, bootstrap, curves, proportion
from fdslam.metrics.accuracy import needed_positions, rank_cells
from tests import reference
from tests.metrics.scenes import make, ranks_of, scenes_with_maps, ties

PERCENTS = [5, 20, 50, 100]


NAMES = [f"{i:02d}" for i in range(12)]


def drawn_weights(scene, seed, replicates=4):
    """Multiplicities [R, Q] of the sorted queries, and of the listed ones for the oracle."""
    weights = bootstrap.resample([scene.names[i] for i in scene.by_name], replicates, seed)
    listed = np.empty_like(weights)
    listed[:, list(scene.by_name)] = weights
    return weights, listed.tolist()


def near(value, expected):
    return (np.isnan(value) and expected is None) or value == pytest.approx(expected, rel=1e-9)


def percent(hits, times, scene):
    """The percentage of found objects, those of a query counted as often as it was drawn."""
    number = [times[q] for q, _ in reference.objects(scene)]
    return 100 * sum(h * n for h, n in zip(hits, number, strict=True)) / sum(number) if sum(number) else None


@settings(max_examples=40, deadline=None)
@given(scenes_with_maps(), st.integers(0, 1000), st.sampled_from([0.5, 1.0]))
def test_pooled_coverage_matches_literal_resampling(drawn, seed, share):
    scene, loc = drawn
    ranking = rank_cells(scene.flatten("map", loc), scene, 0)
    weights, listed = drawn_weights(scene, seed)
    needed, order = needed_positions(ranking.position, scene, share), scene.query_of[ranking.order]
    found = bootstrap.found_in_pool(needed, order, scene.sizes, weights, PERCENTS)
    for x, hits in zip(PERCENTS, found, strict=True):
        values = bootstrap.percent_found(hits, scene.objects.query, weights)
        for value, times in zip(values, listed, strict=True):
            chosen = reference.selected_cells(scene, loc, ties(scene, 0), x, "all", times)
            assert near(value, percent(reference.found_by_coverage(scene, chosen, share), times, scene))


@settings(max_examples=40, deadline=None)
@given(scenes_with_maps(), st.integers(0, 1000))
def test_selected_cells_match_literal_resampling(drawn, seed):
    scene, loc = drawn
    ranking = rank_cells(scene.flatten("map", loc), scene, 0)
    weights, listed = drawn_weights(scene, seed)
    number = bootstrap.selected_in_pool(scene.query_of[ranking.order], scene.sizes, weights, PERCENTS)
    for x, rows in zip(PERCENTS, number, strict=True):
        for row, times in zip(rows, listed, strict=True):
            chosen = reference.selected_cells(scene, loc, ties(scene, 0), x, "all", times)
            for q, i in enumerate(scene.by_name):
                if times[i]:
                    assert row[q] == sum(cell[0] == i for cell in chosen)


@settings(max_examples=60, deadline=None)
@given(scenes_with_maps(), st.integers(0, 1000), st.sampled_from([1, 3000, bootstrap.CHUNK]))
def test_curves_match_literal_resampling(drawn, seed, memory):
    scene, loc = drawn
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bootstrap, "CHUNK", memory)
        weights, listed = drawn_weights(scene, seed)
        result = curve_replicates(scene, loc, weights)
    for *figures, times in zip(*result, listed, strict=True):
        expected = reference.curve(*reference.cells_and_truth(scene, loc, times))
        assert all(near(value, e) for value, e in zip(figures, expected, strict=True))


def curve_replicates(scene, loc, weights, most=bootstrap.STEPS):
    values = scene.flatten("map", loc)
    order = rank_cells(values, scene, 0).order
    steps = bootstrap.curve_steps(curves.thresholds(values[order], scene.positive[order]), most)
    return bootstrap.curve_replicates(steps, scene.query_of[order], scene.positive[order], weights)


@settings(max_examples=40, deadline=None)
@given(scenes_with_maps(most=5), st.integers(0, 1000))
def test_location_controlled_matches_literal_resampling(drawn, seed):
    scene, loc = drawn
    weights, listed = drawn_weights(scene, seed)
    a, valid = curves.location_matrix(ranks_of(scene, loc), scene)
    result = bootstrap.location_replicates(a, valid, scene.objects.query, scene.unchanged, weights)
    for value, times in zip(result, listed, strict=True):
        assert near(value, reference.location_controlled(scene, loc, times) if any(times) else None)


def larger_scene():
    rng = np.random.default_rng(1)
    corners = rng.integers(0, 70, (8, 2))
    boxes = [[(x, y, x + w, y + h)] for (x, y), (w, h) in zip(corners, rng.integers(15, 45, (8, 2)), strict=True)]
    scene = make([f"{i:02d}" for i in range(12)], [(100, 100)] * 12, boxes + [[]] * 4)
    loc = [rng.normal(size=(10, 10)).astype(np.float32) for _ in range(12)]
    for q in range(12):
        changed = scene.positive[100 * q : 100 * (q + 1)].reshape(10, 10)
        loc[q][changed] += 1.5
    return scene, loc


def test_every_query_once_is_the_point_estimate():
    scene, loc = larger_scene()
    once = np.ones((1, 12), dtype=np.int64)
    values = scene.flatten("map", loc)
    ranking = rank_cells(values, scene, 0)
    needed = needed_positions(ranking.position, scene, 0.5)
    found = bootstrap.found_in_pool(needed, scene.query_of[ranking.order], scene.sizes, once, [5, 10, 15, 20])
    assert found[:, 0].any(axis=1).any()
    for x, hits in zip([5, 10, 15, 20], found[:, 0], strict=True):
        np.testing.assert_array_equal(hits, needed <= 1200 * x // 100)
        value = bootstrap.percent_found(hits[None], scene.objects.query, once)
        assert value[0] == 100.0 * sum(needed <= 1200 * x // 100) / 8
    curve = curves.thresholds(values[ranking.order], scene.positive[ranking.order])
    expected = curves.auroc(curve), curves.average_precision(curve), curves.f1_max(curve)
    assert np.ravel(curve_replicates(scene, loc, once)) == pytest.approx(expected, rel=1e-12)
    a, valid = curves.location_matrix(ranks_of(scene, loc), scene)
    again = bootstrap.location_replicates(a, valid, scene.objects.query, scene.unchanged, once)
    assert again[0] == pytest.approx(curves.location_controlled_auroc(a, valid), rel=1e-12)


def test_merged_steps_move_the_curves_little():
    scene, loc = larger_scene()
    weights = bootstrap.resample(NAMES[:12], 50, 0)
    exact, merged = curve_replicates(scene, loc, weights), curve_replicates(scene, loc, weights, most=40)
    steps = bootstrap.curve_steps(curves.thresholds(np.arange(1000.0)[::-1], np.ones(1000, dtype=bool)), 7)
    assert len(steps) == 7
    assert steps[0, 0] == 0
    assert steps[-1, 1] == 1000
    assert steps[1:, 0].tolist() == steps[:-1, 1].tolist()
    for one, two in zip(exact, merged, strict=True):
        assert 0 < np.abs(one - two).max() < 0.02


def test_resampling_draws_as_many_queries_and_is_seeded():
    weights = bootstrap.resample(NAMES[:7], 3000, 3)
    assert weights.shape == (3000, 7)
    assert (weights.sum(axis=1) == 7).all()
    assert np.abs(weights.mean(axis=0) - 1).max() < 0.1
    np.testing.assert_array_equal(weights, bootstrap.resample(NAMES[:7], 3000, 3))
    assert not np.array_equal(weights, bootstrap.resample(NAMES[:7], 3000, 4))
    assert bootstrap.resample(NAMES[:0], 5, 0).shape == (5, 0)


def test_interval_leaves_undefined_replicates_out():
    replicates = np.append(np.arange(101.0), [np.nan] * 7)
    assert bootstrap.interval(40.0, replicates, 0.9) == Figure(40.0, pytest.approx(5.0), pytest.approx(95.0))
    assert bootstrap.interval(40.0, np.full(3, np.nan), 0.9) == Figure(40.0, 40.0, 40.0)


def test_proportion_covers_like_the_binomial():
    hits = np.arange(200) % 4 == 0
    figure = proportion(hits, [f"{i:03d}" for i in range(200)], 2000, 0.95, 0)
    error = 196 * np.sqrt(0.25 * 0.75 / 200)
    assert figure.value == 25.0
    assert figure.low == pytest.approx(25 - error, abs=1)
    assert figure.high == pytest.approx(25 + error, abs=1)
    assert proportion([], [], 10, 0.95, 0) is None
    assert proportion([True], ["a"], 10, 0.95, 0) == Figure(100.0, 100.0, 100.0)


@given(st.lists(st.booleans(), min_size=1, max_size=8), st.randoms(use_true_random=False))
def test_order_of_queries_changes_no_proportion(hits, random):
    names = [str(i) for i in range(len(hits))]
    order = random.sample(range(len(hits)), len(hits))
    one = proportion(hits, names, 20, 0.9, 0)
    assert one == proportion([hits[i] for i in order], [names[i] for i in order], 20, 0.9, 0)


def test_queries_of_one_image_are_drawn_together():
    weights = bootstrap.resample(["a", "b", "a", "c"], 200, 3)
    assert np.array_equal(weights[:, 0], weights[:, 2])
    assert (weights[:, [0, 1, 3]].sum(axis=1) == 3).all()
    assert np.array_equal(weights[:, [0, 1, 3]], bootstrap.resample(["a", "b", "c"], 200, 3))
