"""Queries that see the same scene, each moved by whole cells: what is laid over what is known."""

import numpy as np
import pytest

from fdslam.bow.alignment import NEAR
from fdslam.bow.verification import supporting_matches
from fdslam.compact.alignment import LEAST
from fdslam.compact.sequence import pooled
from fdslam.types import CELL, Features
from tests.bow.test_verification import features
from tests.reference.compact import gaussian_sum

SIZE = (120, 160)


def walk(count, step=CELL):
    """Keypoints of queries that go along a wall, ``step`` pixels each, in front of which nothing stands."""
    rng = np.random.default_rng(0)
    wall = (rng.random((400, 2)) * (160 + step * count, 120)).astype(np.float32)
    descriptors = rng.integers(0, 256, (400, 32), np.uint8)
    for i in range(count):
        xy = wall - np.array([step * i, 0], np.float32)
        seen = ((xy >= 0) & (xy < (160, 120))).all(axis=1)
        yield Features(xy[seen], descriptors[seen])


def maps(count):
    rng = np.random.default_rng(1)
    return [rng.random((12, 16)).astype(np.float32) for _ in range(count)]


def test_none_before_change_nothing():
    loc, seen = maps(3), [*walk(3)]
    for one, two in zip(pooled(loc, [SIZE] * 3, seen.__getitem__, 0), loc, strict=True):
        assert np.array_equal(one, two)
    assert np.array_equal(pooled(loc, [SIZE] * 3, seen.__getitem__, 2)[0], loc[0])
    assert pooled([], [], seen.__getitem__, 2) == []


@pytest.mark.parametrize("previous", [1, 2])
def test_those_before_are_laid_over_the_present_one(previous):
    loc, seen = maps(4), [*walk(4)]
    found = pooled(loc, [SIZE] * 4, seen.__getitem__, previous)
    for query in range(4):
        assert found[query].dtype == np.float32
        assert found[query].shape == (12, 16)
        for col in range(16):
            # A cell of this query was one column further right in the one before.
            same = [loc[query][:, col]]
            for back in range(1, min(previous, query) + 1):
                if col + back < 16:
                    same.append(loc[query - back][:, col + back])
            low, high = np.min(same, axis=0) - 0.01, np.max(same, axis=0) + 0.01
            assert ((found[query][:, col] >= low) & (found[query][:, col] <= high)).all()
            if len(same) == 1:
                assert np.allclose(found[query][:, col], same[0], atol=1e-5)


def test_each_counts_by_how_much_is_known_there():
    loc, seen = maps(2), [*walk(2)]
    found = pooled(loc, [SIZE] * 2, seen.__getitem__, 5)[1]
    mine, partners = supporting_matches(seen[1], seen[0], LEAST)
    here = seen[1].xy[mine]
    assert np.allclose(seen[0].xy[partners] - here, (CELL, 0), atol=1e-3)
    for row in range(12):
        for col in range(15):
            near = gaussian_sum(((col + 0.5) * CELL, (row + 0.5) * CELL), here.tolist(), NEAR * np.sqrt(120 * 160))
            weight = near / (near + 1)
            expected = (loc[1][row, col] + weight * loc[0][row, col + 1]) / (1 + weight)
            assert found[row, col] == pytest.approx(expected, abs=0.02)
    assert np.allclose(found[:, 15], loc[1][:, 15], atol=1e-5)  # the one before did not see it


def test_another_place_or_too_few_keypoints_do_not_count():
    loc, [one, two] = maps(2), [*walk(2)]
    few = Features(one.xy[: LEAST - 1], one.descriptors[: LEAST - 1])
    for other in (features(9, 80), few, Features(one.xy[:0], one.descriptors[:0])):
        assert np.allclose(pooled(loc, [SIZE] * 2, [other, two].__getitem__, 3)[1], loc[1], atol=1e-7)


def test_queries_of_several_sizes():
    loc, seen = [maps(1)[0], np.ones((20, 9), np.float32)], [*walk(2)]
    found = pooled(loc, [SIZE, (200, 90)], seen.__getitem__, 1)
    assert found[1].shape == (20, 9)
    assert np.isfinite(found[1]).all()
