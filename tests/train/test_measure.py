"""Figures against counting by hand and by brute force."""

import numpy as np
import pytest
from sklearn.metrics import confusion_matrix, jaccard_score

from experiments.train.measure import Found, average_precision, box_iou, confusion, iou, match, merged_iou, recall


def test_confusion_and_iou_against_sklearn():
    rng = np.random.default_rng(0)
    true, said = rng.integers(0, 5, (2, 30, 40)).astype(np.uint8)
    table = confusion(true, said, 5)
    assert (table == confusion_matrix(true.ravel(), said.ravel())).all()
    np.testing.assert_allclose(iou(table), jaccard_score(true.ravel(), said.ravel(), average=None))
    merged = jaccard_score(np.isin(true, (0, 1)).ravel(), np.isin(said, (0, 1)).ravel())
    assert merged_iou(table, (0, 1)) == pytest.approx(merged)
    assert np.isnan(iou(np.zeros((2, 2), int))).all()


def test_box_iou_against_pixels():
    rng = np.random.default_rng(1)
    corners = rng.integers(0, 30, (2, 6, 2, 2))
    a, b = (np.concatenate([c.min(1), c.max(1) + 1], 1).astype(np.float32) for c in corners)

    def pixels(box: np.ndarray) -> np.ndarray:
        x0, y0, x1, y1 = box.astype(int)
        grid = np.zeros((32, 32), bool)
        grid[y0:y1, x0:x1] = True
        return grid

    slow = [[(pixels(x) & pixels(y)).sum() / (pixels(x) | pixels(y)).sum() for y in b] for x in a]
    np.testing.assert_allclose(box_iou(a, b), slow, rtol=1e-6)


def test_matching_takes_each_object_once_and_forgives_what_is_not_asked_for():
    true = np.array([[0, 0, 10, 10], [50, 50, 60, 60]], np.float32)
    boxes = np.array([[0, 0, 10, 9], [0, 0, 10, 10], [50, 50, 60, 60], [80, 80, 90, 90]], np.float32)
    found = match(boxes, np.array([0.9, 0.5, 0.7, 0.6], np.float32), true, np.array([True, False]))
    assert found.scores.tolist() == pytest.approx([0.9, 0.7, 0.6, 0.5])
    assert found.hit.tolist() == [True, False, False, False]
    assert found.counts.tolist() == [True, False, True, True]
    assert found.asked == 1
    none = match(np.zeros((0, 4), np.float32), np.zeros(0, np.float32), true, np.array([True, True]))
    assert none.asked == 2
    assert len(none.hit) == 0


def test_average_precision_against_all_thresholds():
    rng = np.random.default_rng(2)
    found = []
    for _ in range(6):
        n = int(rng.integers(1, 9))
        scores = np.sort(rng.random(n).astype(np.float32))[::-1]
        found.append(Found(scores, rng.random(n) < 0.6, rng.random(n) < 0.9, n))
    hit = np.concatenate([f.hit[f.counts] for f in found])
    scores = np.concatenate([f.scores[f.counts] for f in found])
    asked = sum(f.asked for f in found)
    points = [(hit[scores >= s].sum() / asked, hit[scores >= s].mean()) for s in np.sort(scores)[::-1]]
    area, before = 0.0, 0.0
    for r, _ in points:
        area += (r - before) * max(p for other, p in points if other >= r)
        before = r
    assert average_precision(found) == pytest.approx(area)
    assert recall(found, 100) == sum(int(f.hit.sum()) for f in found) / asked
    assert recall(found, 1) == sum(int(f.hit[:1].sum()) for f in found) / asked
    assert np.isnan(average_precision([Found(np.zeros(0), np.zeros(0, bool), np.zeros(0, bool), 0)]))
