"""The published format: a line with width and height, then ``row col src_row src_col``."""

from pathlib import Path

import numpy as np
import pytest

from fdslam.data.nclt.undistortion import read_undistortion
from fdslam.errors import InputError
from tests.data.worlds import texture

HEADER = "width/cols = 16 , height/rows = 12"
RAW = texture(0, 12, 16)


def lines(source=lambda row, column: (row, column)):
    return [
        f"{r} {c} {source(r, c)[0]:.6f} {source(r, c)[1]:.6f}" for r in range(12) for c in range(16)
    ]  # the order of the published file


def written(path, rows, header=HEADER):
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


def test_every_pixel_comes_from_where_its_line_says(tmp_path):
    rng = np.random.default_rng(0)
    source = {(r, c): (int(rng.integers(12)), int(rng.integers(16))) for r in range(12) for c in range(16)}
    flat = read_undistortion(written(tmp_path / "u.txt", lines(lambda r, c: source[r, c])))(RAW, Path("a.tiff"))
    for (r, c), (y, x) in source.items():
        assert flat[r, c].tolist() == RAW[y, x].tolist()


def test_between_pixels_it_is_bilinear_and_outside_black(tmp_path):
    flat = read_undistortion(written(tmp_path / "u.txt", lines(lambda r, c: (r + 0.5, c + 0.25))))(RAW, Path("a.tiff"))
    left, right = RAW[3, 4] * 0.75 + RAW[3, 5] * 0.25, RAW[4, 4] * 0.75 + RAW[4, 5] * 0.25
    np.testing.assert_allclose(flat[3, 4], (left + right) / 2, atol=1)
    away = read_undistortion(written(tmp_path / "u.txt", lines(lambda r, c: (r + 100, c))))(RAW, Path("a.tiff"))
    assert (away == 0).all()


@pytest.mark.parametrize(
    ("rows", "header"),
    [
        (lines(), "16"),
        (lines(), ""),
        (lines(), "width 0, height 12"),
        (lines(), "width 160000, height 120000"),
        (lines()[:-1], HEADER),
        ([*lines(), "3 3 3 3"], HEADER),
        ([*lines()[:-1], lines()[0]], HEADER),
        ([*lines()[:-1], "12 0 1 1"], HEADER),
        ([*lines()[:-1], "11 15 nan 1"], HEADER),
        ([*lines()[:-1], "11 15 1"], HEADER),
        ([*lines()[:-1], "11 15 one 1"], HEADER),
        ([], HEADER),
    ],
)
@pytest.mark.filterwarnings("ignore:loadtxt")
def test_a_torn_table_is_named(tmp_path, rows, header):
    path = written(tmp_path / "U2D_Cam5_1616X1232.txt", rows, header)
    with pytest.raises(InputError, match=r"U2D_Cam5_1616X1232\.txt: .*unpack the file again") as error:
        read_undistortion(path)
    assert "\n" not in str(error.value)


def test_an_image_of_another_size_is_named(tmp_path):
    table = read_undistortion(written(tmp_path / "u.txt", lines()))
    with pytest.raises(InputError, match=r"5\.tiff: is 18×12 pixels, u\.txt is for 16×12"):
        table(texture(0, 12, 18), Path("5.tiff"))
