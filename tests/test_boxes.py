"""Candidate boxes; the oracle floods cell by cell."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fdslam.boxes import FEWEST, candidates


def flooded(places, height, width, share, top):
    least = 1 - share / 100
    left = {(int(r), int(c)) for r, c in zip(*np.nonzero(places > least), strict=True)}
    groups = []
    while left:
        group, waiting = set(), [left.pop()]
        while waiting:
            row, column = waiting.pop()
            group.add((row, column))
            near = {(row + i, column + j) for i in (-1, 0, 1) for j in (-1, 0, 1)} & left
            left -= near
            waiting += near
        groups.append(group)
    boxes = []
    for group in groups:
        if len(group) < FEWEST:
            continue
        rows, columns = [r for r, _ in group], [c for _, c in group]
        box = (10 * min(columns), 10 * min(rows), min(10 * max(columns) + 10, width), min(10 * max(rows) + 10, height))
        boxes.append((sum((float(places[cell]) - least) / (1 - least) for cell in group), box))
    best = []
    for score, box in sorted(boxes, key=lambda one: (-one[0], one[1])):
        hidden = any(b[0] <= box[0] and b[1] <= box[1] and b[2] >= box[2] and b[3] >= box[3] for _, b in best)
        if not hidden and len(best) < top:
            best.append((score, box))
    return best


@given(st.integers(0, 10_000), st.sampled_from([5, 30, 60]), st.integers(0, 6))
def test_candidates_are_those_of_a_flood(seed, share, top):
    rng = np.random.default_rng(seed)
    height, width = (int(side) for side in rng.integers(16, 140, 2))
    places = rng.random((-(-height // 10), -(-width // 10))).astype(np.float32) ** rng.choice([0.2, 1])
    found = candidates(places, height, width, share, top)
    expected = flooded(places, height, width, share, top)
    assert [tuple(one.xyxy.tolist()) for one in found] == [box for _, box in expected]
    np.testing.assert_allclose([one.score for one in found], [score for score, _ in expected], rtol=1e-5)


def test_a_corner_joins_and_the_border_is_cut():
    places = np.zeros((4, 5), np.float32)
    places[0:2, 0] = places[2:4, 1] = 0.99
    [one] = candidates(places, 33, 45)
    assert one.xyxy.tolist() == [0, 0, 20, 33]
    assert one.xyxy.dtype == np.float32


def test_an_unchanged_image_of_a_pool_has_none():
    assert candidates(np.full((6, 6), 0.95, np.float32), 60, 60) == ()
