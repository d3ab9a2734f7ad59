import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdslam.obb.yolo.letterbox import letterbox
from tests.reference import letterbox as reference

SIDES = st.integers(16, 3000)


def placed(box):
    return box.scaled_height, box.scaled_width, box.top, box.left


@pytest.mark.parametrize("placement", ["corner", "centre"])
@pytest.mark.parametrize("size", [(36, 48), (48, 36), (17, 61), (20, 20), (97, 41)])
def test_every_pixel_is_where_the_loop_puts_it(size, placement):
    image = np.random.default_rng(0).integers(0, 256, (*size, 3)).astype(np.uint8)
    box = letterbox(*size, 32, 40, placement)
    slow = reference.draw(image, 32, 40, *placed(box))
    fast = box.draw(image)
    assert fast.dtype == np.uint8
    assert np.abs(fast - slow).max() <= 1  # of 255: OpenCV interpolates in integers
    grey = np.ones((32, 40), bool)
    grey[box.top : box.top + box.scaled_height, box.left : box.left + box.scaled_width] = False
    assert (fast[grey] == 114).all()


@pytest.mark.parametrize("placement", ["corner", "centre"])
@given(SIDES, SIDES, st.sampled_from([(416, 416), (640, 640), (384, 640)]))
def test_sizes_are_the_published_ones_but_for_the_rounding_of_floats(placement, height, width, canvas):
    ours = placed(letterbox(height, width, *canvas, placement))
    theirs = reference.sizes(height, width, *canvas, placement)
    ratio = min(canvas[0] / height, canvas[1] / width)
    for axis, side in enumerate((height, width)):
        if (
            canvas[axis] / side == ratio
        ):  # it decides, and fills the canvas, which int(side * ratio) may miss by a pixel
            assert (ours[axis], ours[axis + 2]) == (canvas[axis], 0)
            continue
        # Where its size is whole (or half, for the centre) to within rounding, floats may fall on the other side.
        unit = 1 if placement == "corner" else 2
        if abs(unit * ratio * side - round(unit * ratio * side)) > 1e-6:
            assert (ours[axis], ours[axis + 2]) == (max(1, theirs[axis]), theirs[axis + 2])


def test_sizes_by_hand():
    assert placed(letterbox(361, 480, 416, 416, "corner")) == (312, 416, 0, 0)  # 312.87
    assert placed(letterbox(361, 480, 416, 416, "centre")) == (313, 416, 51, 0)  # 103 rows of grey: 51 above
    assert placed(letterbox(480, 361, 416, 416, "centre")) == (416, 313, 0, 51)


@pytest.mark.parametrize("placement", ["corner", "centre"])
@given(SIDES, SIDES, st.integers(0, 2**32 - 1))
def test_there_and_back(placement, height, width, seed):
    box = letterbox(height, width, 416, 416, placement)
    corners = np.sort(np.random.default_rng(seed).uniform(0, 1, (5, 2, 2)), axis=1) * [width, height]
    image = corners.reshape(5, 4)
    scale = np.tile([box.scaled_width / width, box.scaled_height / height], 2)
    canvas = image * scale + np.tile([box.left, box.top], 2)
    assert np.allclose(box.back(canvas), image, atol=1e-9)


def test_what_lies_on_the_grey_is_cut_off():
    box = letterbox(100, 200, 64, 64, "centre")
    assert (box.scaled_height, box.top) == (32, 16)
    assert box.back(np.array([[0.0, 0.0, 64.0, 64.0]])).tolist() == [[0, 0, 200, 100]]
    assert box.back(np.array([[0.0, 0.0, 32.0, 16.0]])).tolist() == [[0, 0, 100, 0]]


def test_a_painted_pixel_lands_in_the_scaled_box():
    image = np.zeros((60, 120, 3), np.uint8)
    image[20:40, 60:90] = 255
    box = letterbox(60, 120, 64, 64, "centre")
    y, x = np.nonzero(box.draw(image)[..., 0] > 200)
    found = box.back(np.array([[x.min(), y.min(), x.max() + 1, y.max() + 1]], float))
    assert np.abs(found - [60, 20, 90, 40]).max() < 120 / 64 + 1e-9  # a pixel of the canvas
