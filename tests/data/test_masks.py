"""Areas are held against scipy's labelling, pixel by pixel."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image
from scipy import ndimage

from fdslam.data.masks import CHANGESIM, areas, read_mask
from fdslam.errors import InputError
from fdslam.types import Frame
from tests.data.pair_sets import HEIGHT, PATCH, WIDTH, coloured, mask_of, save

FRAME = Frame("t1/a.png", "", "", HEIGHT, WIDTH)
CHANGED = mask_of(True) > 0


def read(path, reading="white"):
    return read_mask(path, FRAME, reading)


@pytest.mark.parametrize("high", [1, 255])
@pytest.mark.parametrize("suffix", ["png", "bmp", "tiff"])
def test_zero_and_one_and_zero_and_255_are_the_same(tmp_path, high, suffix):
    path = save(tmp_path / f"a.{suffix}", mask_of(True, high=high))
    assert np.array_equal(read(path), CHANGED)
    assert np.array_equal(read(path, "black"), ~CHANGED)


@pytest.mark.parametrize("mode", ["1", "P", "RGB", "RGBA", "LA"])
def test_other_modes_of_a_black_and_white_image(tmp_path, mode):
    path = tmp_path / "a.png"
    Image.fromarray(mask_of(True)).convert(mode).save(path)
    assert np.array_equal(read(path), CHANGED)


def test_an_empty_and_a_full_mask(tmp_path):
    assert not read(save(tmp_path / "a.png", mask_of(False))).any()
    for value in (1, 255):
        assert read(save(tmp_path / "a.png", np.full((HEIGHT, WIDTH), value))).all()


@pytest.mark.parametrize(
    ("mask", "said"),
    [
        (mask_of(True, high=128), "holds the values 0, 128; a mask of change holds 0 and 255, or 0 and 1"),
        (mask_of(True, 1, 255), "holds the values 1, 255"),
        (mask_of(True, high=2), "holds the values 0, 2"),
        (np.arange(HEIGHT * WIDTH).reshape(HEIGHT, WIDTH) % 10, "holds the values 0, 1, 2, 3, 4, 5 and 4 more"),
        (coloured(True, (255, 0, 0)), "holds the colours #000000, #ff0000"),
    ],
)
def test_other_values_are_named(tmp_path, mask, said):
    path = save(tmp_path / "a.png", mask)
    for reading in ("white", "black"):
        with pytest.raises(InputError, match=rf"a\.png: {said}"):
            read(path, reading)


def test_jpeg_is_said_to_blur(tmp_path):
    with pytest.raises(InputError, match=r"a\.jpg: holds the values .*JPEG blurs a mask: save it as PNG"):
        read(save(tmp_path / "a.jpg", mask_of(True)))


def test_the_colours_of_vl_cmu_cd(tmp_path):
    mask = coloured(True, (136, 0, 21))
    mask[:30] = 255
    assert np.array_equal(read(save(tmp_path / "a.png", mask), "coloured"), CHANGED)


def test_the_classes_of_pscd_and_changesim(tmp_path):
    assert np.array_equal(read(save(tmp_path / "a.png", mask_of(True, high=7)), "nonzero"), CHANGED)
    for code, name in CHANGESIM.items():
        path = save(tmp_path / "a.png", coloured(True, (code >> 16, (code >> 8) & 255, code & 255)))
        assert np.array_equal(read(path, "changesim"), CHANGED & (name != "static"))
    with pytest.raises(
        InputError, match="holds the colours #010203; a mask of ChangeSim holds #000000 static, #512600"
    ):
        read(save(tmp_path / "a.png", coloured(True, (1, 2, 3))), "changesim")


def test_another_size_another_depth_and_a_torn_file_are_named(tmp_path):
    with pytest.raises(InputError, match=r"a\.png: the mask is 161×120 pixels, its image t1/a\.png 160×120"):
        read(save(tmp_path / "a.png", np.zeros((HEIGHT, WIDTH + 1))))
    Image.fromarray(mask_of(True).astype(np.uint16)).save(tmp_path / "deep.png")
    with pytest.raises(InputError, match=r"deep\.png: more than 8 bit"):
        read(tmp_path / "deep.png")
    path = save(tmp_path / "torn.png", np.random.default_rng(0).integers(0, 2, (HEIGHT, WIDTH)))
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(InputError, match=r"torn\.png: damaged image"):
        read(path)


def test_areas_touch_at_corners_and_small_ones_are_left_out():
    changed = np.zeros((20, 30), bool)
    changed[2:4, 20:22] = changed[4:6, 22:24] = True  # joined by a corner
    changed[10, 5:8] = True
    assert areas(changed, 1).tolist() == [[20, 2, 24, 6], [5, 10, 8, 11]]
    assert areas(changed, 4).tolist() == [[20, 2, 24, 6]]
    assert areas(changed, 9).shape == (0, 4)
    assert areas(changed, 1).dtype == np.float32
    assert areas(~np.zeros((20, 30), bool), 1).tolist() == [[0, 0, 30, 20]]


@given(arrays(bool, (9, 12), elements=st.booleans()), st.integers(1, 6))
def test_areas_are_those_of_scipy(changed, min_area):
    labels, count = ndimage.label(changed, np.ones((3, 3)))
    expected = []
    for label, (rows, columns) in enumerate(ndimage.find_objects(labels, count), 1):
        if (labels == label).sum() >= min_area:
            expected.append([columns.start, rows.start, columns.stop, rows.stop])
    found = areas(changed, min_area).tolist()
    assert sorted(found) == sorted(expected)
    assert found == sorted(found, key=lambda box: (box[1], box[0], box[3], box[2]))


def test_the_patch_of_these_tests_is_an_area():
    assert areas(CHANGED, 100).tolist() == [[PATCH[1].start, PATCH[0].start, PATCH[1].stop, PATCH[0].stop]]
