"""Oracle: the promises of the docstrings, counted cell by cell."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdslam.compact.canvas import COARSEST, LARGER, OVERLAP, STRIDES, canvas_of
from fdslam.config import Dense
from fdslam.obb.yolo.letterbox import GREY

SIDE = st.integers(16, 4000)
INPUT = st.sampled_from([(0, 0), (416, 416), (320, 320), (256, 512), (640, 384)])
BITS = st.sampled_from([64, 128, 192, 256])


def stored_bytes(canvas, config):
    """What the descriptors of both strides take."""
    fine, coarse = (rows * cols for rows, cols in map(canvas.grid_shape, STRIDES))
    return fine * config.fine_bits / 8 + coarse * config.coarse_bits / 8


def covered(length, tile, starts):
    seen = np.zeros(length, int)
    for start in starts:
        seen[start : start + tile] += 1
    return seen


@given(SIDE, SIDE, INPUT, BITS, BITS, st.sampled_from([1.0, 8.0, 25.0, 60.0]))
def test_descriptors_fit_into_the_bytes_that_there_are(height, width, size, fine, coarse, kilobytes):
    config = Dense(fine_bits=fine, coarse_bits=coarse, kilobytes=kilobytes)
    assert stored_bytes(canvas_of(height, width, *size, config), config) <= 1000 * kilobytes


def test_a_long_strip_fits_too():
    for height, width in ((1, 5000), (5000, 1), (16, 4000), (7, 100_000)):
        for size in ((0, 0), (416, 416)):
            assert stored_bytes(canvas_of(height, width, *size, Dense()), Dense()) <= 25_000


@given(SIDE, SIDE, INPUT)
def test_the_bytes_are_used(height, width, size):
    # An image is no smaller than it must be: for the bytes, for the input, or because it is not enlarged further.
    canvas = canvas_of(height, width, *size, Dense())
    scale = max(canvas.height / height, canvas.width / width)
    fits = size[0] and (canvas.height >= 0.97 * size[0] or canvas.width >= 0.97 * size[1])
    assert stored_bytes(canvas, Dense()) > 0.8 * 25_000 or scale > 0.97 * LARGER or fits


@given(SIDE, SIDE, INPUT)
def test_tiles_cover_the_image_and_lie_on_one_grid(height, width, size):
    canvas = canvas_of(height, width, *size, Dense())
    for length, tile, starts in (
        (canvas.height, canvas.tile_height, canvas.tops),
        (canvas.width, canvas.tile_width, canvas.lefts),
    ):
        assert starts[0] == 0
        assert all(start % COARSEST == 0 for start in starts)
        assert list(starts) == sorted(set(starts))
        seen = covered(length, tile, starts)
        assert seen.min() >= 1
        assert len(starts) == 1 or starts[-1] < length  # the last one sees something
        assert all(before + tile - after >= OVERLAP for before, after in pairwise(starts))
    assert abs(canvas.height / height - canvas.width / width) <= 0.51 / height + 0.51 / width


@pytest.mark.parametrize("size", [(360, 480), (480, 640), (1080, 1920 * 3 // 4), (500, 400)])
def test_one_tile_where_the_aspect_fits(size):
    canvas = canvas_of(*size, 416, 416, Dense(kilobytes=1000))
    assert (canvas.tops, canvas.lefts) == ((0,), (0,))
    assert max(canvas.height, canvas.width) <= 416


def test_tiles_where_most_of_the_input_would_be_empty():
    canvas = canvas_of(600, 1600, 416, 416, Dense(kilobytes=1000))
    assert canvas.height == 416
    assert len(canvas.lefts) > 1
    upright = canvas_of(1600, 600, 416, 416, Dense(kilobytes=1000))
    assert (upright.tops, upright.lefts) == (canvas.lefts, canvas.tops)


@pytest.mark.parametrize("size", [(16, 4000), (4000, 16), (1, 1), (360, 480), (33, 31)])
@pytest.mark.parametrize("tile", [(0, 0), (416, 416), (64, 96)])
def test_what_is_drawn_is_the_image_on_grey(size, tile):
    image = np.random.default_rng(0).integers(150, 256, (*size, 3), np.uint8)
    canvas = canvas_of(*size, *tile, Dense())
    drawn = canvas.draw(image)
    assert drawn.dtype == np.uint8
    assert drawn.shape == (canvas.tops[-1] + canvas.tile_height, canvas.lefts[-1] + canvas.tile_width, 3)
    assert (drawn[: canvas.height, : canvas.width] > 140).all()
    assert (drawn[canvas.height :] == GREY).all()
    assert (drawn[:, canvas.width :] == GREY).all()
    assert canvas.grid_shape(8) == (len(range(0, canvas.height, 8)), len(range(0, canvas.width, 8)))
