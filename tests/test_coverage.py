"""Oracles: a loop over boxes and pixels, and tests.reference.cell_maximum."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fdslam.coverage import Coverage, cell_maximum
from fdslam.types import CELL
from tests import reference


def boxes_of(seed, height, width, count):
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-10, max(height, width) + 10, (count, 2, 2))
    boxes = np.concatenate([corners.min(axis=1), corners.max(axis=1)], axis=1).astype(np.float32)
    boxes[::2] = np.rint(boxes[::2])
    return boxes


@given(st.integers(0, 10_000), st.integers(1, 45), st.integers(1, 45), st.integers(0, 6))
def test_sums_equal_the_loop_over_pixels(seed, height, width, count):
    boxes = boxes_of(seed, height, width, count)
    values = np.random.default_rng(seed).integers(-5, 1 << 40, (2, count))
    expected = np.zeros((2, height, width), np.int64)
    for j, (x0, y0, x1, y1) in enumerate(boxes):
        for y in range(height):
            for x in range(width):
                if x0 <= x < x1 and y0 <= y < y1:
                    expected[:, y, x] += values[:, j]
    coverage = Coverage(boxes, height, width)
    painted = coverage.paint(values)
    for layer in range(2):
        assert np.array_equal(coverage.pixels(painted[layer]), expected[layer])
        assert np.array_equal(coverage.cells(painted[layer]), reference.cell_maximum(expected[layer], CELL))


@given(st.integers(0, 10_000), st.integers(1, 33), st.integers(1, 33))
def test_cell_maximum_equals_the_loop(seed, height, width):
    pixels = np.random.default_rng(seed).normal(size=(height, width))
    assert np.array_equal(cell_maximum(pixels), reference.cell_maximum(pixels, CELL))
