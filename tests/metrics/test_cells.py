"""Oracle: painted pixels."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fdslam.metrics import box_overlap, cell_areas, positive_cells
from fdslam.metrics.cells import at_least
from tests import reference
from tests.metrics.scenes import boxes_in


@pytest.mark.parametrize("size", [(35, 42), (40, 50), (1, 1), (9, 10)])
def test_areas_are_pixel_counts(size):
    expected = [np.ones(size)[reference.pixels_of(r, c, *size)].sum() for r, c in reference.grid(*size)]
    assert cell_areas(*size).ravel().tolist() == expected
    assert cell_areas(*size).sum() == size[0] * size[1]


@settings(max_examples=30, deadline=None)
@given(st.tuples(*[st.integers(-40, 240)] * 4))
def test_overlap_is_exact_for_quarter_pixels(corners):
    x0, x1 = sorted(corners[:2])
    y0, y1 = sorted(corners[2:])
    box = np.array([x0, y0, x1, y1]) / 4
    fine = reference.paint(box, 35, 42, scale=4)
    expected = [
        fine[4 * rows.start : 4 * rows.stop, 4 * cols.start : 4 * cols.stop].sum() / 16
        for rows, cols in (reference.pixels_of(r, c, 35, 42) for r, c in reference.grid(35, 42))
    ]
    assert box_overlap(box, 35, 42).ravel().tolist() == expected


@settings(max_examples=60, deadline=None)
@given(boxes_in(35, 42))
def test_positive_cells_match_painted_pixels(boxes):
    assert set(zip(*np.nonzero(positive_cells(boxes, 35, 42)), strict=True)) == reference.positive_cells(boxes, 35, 42)


def cells(boxes, height=35, width=42):
    return np.argwhere(positive_cells(boxes, height, width)).tolist()


def test_half_a_cell_is_positive_and_less_is_not():
    assert cells([[0, 0, 15, 10]]) == [[0, 0], [0, 1]]
    assert cells([[0, 0, 14.99, 10]]) == [[0, 0]]


def test_half_of_a_partial_cell_is_of_its_clipped_area():
    assert cells([[20, 10, 41, 20]]) == [[1, 2], [1, 3], [1, 4]]  # the last column is 2 pixels wide


def test_tiny_boxes_take_the_cell_of_their_centre():
    assert cells([[18, 8, 23, 11]]) == [[0, 2]]
    assert cells([[40.5, 33, 60, 90], [11, 11, 12, 12]]) == [[1, 1], [3, 4]]
    assert cells([[-90, 0, 3, 3]]) == [[0, 0]]
    assert cells([[35, 10, 60, 14]]) == [[1, 3]]  # the centre of its part inside the image, not the one at x = 47
    assert cells([[36, 0, 42, 10]]) == [[0, 4]]  # has a cell, so the centre in column 3 does not matter


def test_boxes_outside_take_nothing():
    assert cells([[50, 0, 60, 10], [0, -9, 10, 0], [5, 5, 5, 9], [9, 9, 3, 3]]) == []
    assert cells(np.zeros((0, 4))) == []


def test_each_box_counts_alone():
    """Two boxes of a third of a cell each cover two thirds together, and yet only the centre rule applies."""
    assert cells([[10, 10, 20, 13], [10, 15, 20, 18]]) == [[1, 1]]
    assert cells([[8, 0, 13, 10], [13, 0, 18, 10]]) == [[0, 1]]


def test_exactly_the_share_counts_despite_rounding():
    third = np.float64(1) / 3
    assert at_least(third * 1.5, third + third + third, 0.5)
    assert at_least(np.cumsum(np.full(10, 0.1))[-1], 1.0, 1.0)  # the sum is 0.9999999999999999
    assert not at_least(0.4999999, 1.0, 0.5)
