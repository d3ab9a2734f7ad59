from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdslam.config import Yolo
from fdslam.obb.yolo.tiles import tiles_of


def test_a_wide_image_has_three_tiles():
    found = tiles_of(384, 1024, 416, 416, Yolo())
    assert found == [(0, 0, 384, 384), (320, 0, 704, 384), (640, 0, 1024, 384)]


@pytest.mark.parametrize("size", [(360, 480), (404, 308), (1616, 1232), (100, 199)])
def test_a_usual_image_is_seen_whole(size):
    assert tiles_of(*size, 416, 416, Yolo()) == [(0, 0, size[1], size[0])]


def test_told_so_or_not():
    assert tiles_of(384, 1024, 416, 416, Yolo(tile="never")) == [(0, 0, 1024, 384)]
    assert len(tiles_of(360, 480, 416, 416, Yolo(tile="always"))) == 2
    assert len(tiles_of(1616, 1232, 416, 416, Yolo(tile="always", tile_side=640))) == 3 * 3


def test_an_image_smaller_than_a_tile_is_its_only_tile():
    assert tiles_of(60, 80, 416, 416, Yolo(tile="always", tile_side=640)) == [(0, 0, 80, 60)]
    assert tiles_of(60, 2000, 416, 416, Yolo(tile_side=640))[0] == (0, 0, 640, 60)


def test_a_tile_has_the_aspect_of_the_canvas():
    assert tiles_of(384, 1024, 256, 512, Yolo()) == [(0, 0, 1024, 384)]  # it fills three quarters of it
    assert tiles_of(200, 1200, 256, 512, Yolo())[0] == (0, 0, 400, 200)


@given(
    st.integers(16, 2000),
    st.integers(16, 2000),
    st.sampled_from(["auto", "always"]),
    st.sampled_from([0, 100, 640]),
    st.floats(0, 0.6),
)
def test_tiles_cover_the_image_and_overlap(height, width, tile, side, overlap):
    found = tiles_of(height, width, 416, 416, Yolo(tile=tile, tile_side=side, overlap=overlap))
    covered = np.zeros((height, width), bool)
    for x0, y0, x1, y1 in found:
        assert 0 <= x0 < x1 <= width
        assert 0 <= y0 < y1 <= height
        covered[y0:y1, x0:x1] = True
    assert covered.all()
    tops, lefts = sorted({(t[1], t[3]) for t in found}), sorted({(t[0], t[2]) for t in found})
    assert len(found) == len(tops) * len(lefts)
    for row in (tops, lefts):
        for (_, end), (begin, stop) in pairwise(row):
            assert end - begin >= overlap * (stop - begin) - 1.5  # starts are whole pixels
