"""Oracles: closed form for the blob, painted pixels for objectness, statistics for the random fields."""

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.ndimage import gaussian_filter

from fdslam.controls import CONTROLS, centre_blob, control, objectness, random, smooth_random
from tests import reference
from tests.metrics.scenes import boxes_in

NAMES, HEIGHTS, WIDTHS = ("a", "b", "c"), (35, 360, 9), (42, 481, 5)


@pytest.mark.parametrize("kind", CONTROLS)
def test_shape_dtype_and_independence_of_the_order(kind):
    maps = control(kind, NAMES, HEIGHTS, WIDTHS, 0)
    assert [m.shape for m in maps] == [(4, 5), (36, 49), (1, 1)]
    assert all(m.dtype == np.float32 and np.isfinite(m).all() for m in maps)
    back = control(kind, NAMES[::-1], HEIGHTS[::-1], WIDTHS[::-1], 0)[::-1]
    assert all(np.array_equal(one, two) for one, two in zip(maps, back, strict=True))


@pytest.mark.parametrize("make", [random, smooth_random])
def test_random_maps_depend_on_seed_and_name(make):
    first = make("a", 360, 480, 0)
    assert np.array_equal(first, make("a", 360, 480, 0))
    for other in (make("b", 360, 480, 0), make("a", 360, 480, 1)):
        assert abs(np.corrcoef(first.ravel(), other.ravel())[0, 1]) < 0.5


def test_random_is_uniform_without_neighbourhood():
    cells = random("a", 1000, 1000, 0)
    assert 0 <= cells.min() < 0.01
    assert 0.99 < cells.max() < 1
    assert abs(cells.mean() - 0.5) < 0.01
    assert abs(np.corrcoef(cells[:, 1:].ravel(), cells[:, :-1].ravel())[0, 1]) < 0.05


def correlation(cells, lag):
    return np.corrcoef(cells[:, lag:].ravel(), cells[:, :-lag].ravel())[0, 1]


def test_smooth_random_has_the_correlation_of_smoothed_pixels():
    """White pixels smoothed with σ have the correlation exp(-d² / 4σ²) at a distance of d pixels."""
    cells = smooth_random("a", 6000, 6000, 0)
    for lag in (2, 4, 8):
        assert correlation(cells, lag) == pytest.approx(np.exp(-((10 * lag) ** 2) / (4 * 40**2)), abs=0.08)
    pixels = gaussian_filter(np.random.default_rng(0).standard_normal((1200, 1200)), 40)
    cells = pixels.reshape(120, 10, 120, 10).max(axis=(1, 3))
    assert correlation(cells, 4) == pytest.approx(np.exp(-0.25), abs=0.15)


def test_smooth_random_favours_no_position():
    fields = np.stack([smooth_random(str(i), 200, 300, 0) for i in range(600)])
    deviation = fields.std(axis=0)
    assert deviation.max() / deviation.min() < 1.25
    assert np.abs(fields.mean(axis=0)).max() < 0.25 * deviation.mean()


def test_centre_blob():
    blob = centre_blob("a", 100, 205, 0)
    assert blob.shape == (10, 21)
    for row, col, y, x in ((6, 10, 65, 105), (0, 0, 5, 5), (9, 20, 95, 202.5)):
        expected = np.exp(-(((y - 62) / 16) ** 2 + ((x - 102.5) / 61.5) ** 2) / 2)
        assert blob[row, col] == pytest.approx(expected, rel=1e-5)
    assert np.unravel_index(blob.argmax(), blob.shape)[0] in (5, 6)
    assert np.array_equal(blob, centre_blob("b", 100, 205, 9))


@settings(max_examples=40, deadline=None)
@given(boxes_in(35, 42, most=5))
def test_objectness_counts_painted_boxes(boxes):
    count = sum((reference.paint(box, 35, 42).astype(int) for box in boxes), np.zeros((35, 42), int))
    expected = [count[reference.pixels_of(r, c, 35, 42)].max() for r, c in reference.grid(35, 42)]
    cells = objectness(np.array(boxes), 35, 42)
    assert cells.dtype == np.float32
    assert cells.ravel().tolist() == expected


def test_objectness_of_fractional_boxes():
    """Pixel x belongs to a box when x0 <= x < x1: 9.5 to 10.5 holds pixel 10, 9.2 to 9.8 none, a reversed box none."""
    cells = objectness([[9.5, 0, 10.5, 1], [9.2, 0, 9.8, 1], [30, 0, 20, 10]], 10, 30)
    assert cells.tolist() == [[0, 1, 0]]
