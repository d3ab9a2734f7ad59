import os

import numpy as np
import pytest
from PIL import Image

from fdslam.data import images
from fdslam.data.images import image_size, read_image, read_labels
from fdslam.errors import InputError


def picture(height=40, width=60):
    return np.random.default_rng(0).integers(0, 256, (height, width, 3), dtype=np.uint8)


@pytest.fixture
def saved(tmp_path):
    def save(name, array=None, mode=None, **options):
        image = Image.fromarray(picture() if array is None else array)
        path = tmp_path / name
        (image.convert(mode) if mode else image).save(path, **options)
        return path

    return save


def test_lossless_images_come_back_as_they_are(saved):
    for name in ("a.png", "a.bmp", "a.tiff"):
        path = saved(name)
        assert image_size(path) == (40, 60)
        assert np.array_equal(read_image(path), picture())


@pytest.mark.parametrize("mode", ["L", "P", "RGBA", "1", "CMYK"])
def test_other_modes_become_rgb(saved, mode):
    image = read_image(saved("a.tiff", mode=mode))
    assert image.shape == (40, 60, 3)
    assert image.dtype == np.uint8


@pytest.mark.parametrize(("suffix", "mode"), [("png", None), ("png", "L"), ("tiff", None)])
def test_exif_rotation_is_applied_to_size_and_pixels(saved, suffix, mode):
    exif = Image.Exif()
    exif[0x0112] = 6  # turn 90° clockwise to see it upright
    expected = read_image(saved(f"b.{suffix}", mode=mode))
    path = saved(f"a.{suffix}", mode=mode, exif=exif)
    assert image_size(path) == (60, 40)
    found = read_image(path)
    assert np.array_equal(found, np.rot90(expected, -1))
    assert found.flags.writeable


@pytest.mark.parametrize("suffix", ["jpg", "png", "tiff"])
def test_a_truncated_image_is_refused_by_name(saved, suffix):
    path = saved(f"a.{suffix}")
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(InputError, match=rf"a\.{suffix}"):
        read_image(path)


def test_what_is_no_image_is_refused_by_name(tmp_path):
    path = tmp_path / "text.png"
    path.write_text("not an image")
    with pytest.raises(InputError, match=r"text\.png"):
        read_image(path)
    with pytest.raises(InputError, match=r"gone\.png: no such image"):
        read_image(tmp_path / "gone.png")


def test_size_limits_hold_before_decoding(saved, monkeypatch):
    with pytest.raises(InputError, match="too small"):
        read_image(saved("tiny.png", picture(8, 60)))
    path = saved("big.png")
    monkeypatch.setattr(images, "MAX_PIXELS", 1000)
    with pytest.raises(InputError, match="above the limit"):
        read_image(path)


def test_sixteen_bit_is_refused_and_not_clipped(saved):
    path = saved("deep.png", (picture()[..., 0].astype(np.uint16) * 200))
    with pytest.raises(InputError, match="more than 8 bit"):
        read_image(path)


def test_labels_must_fit(saved):
    labels = picture()[..., 0] % 5
    path = saved("labels.png", labels)
    assert np.array_equal(read_labels(path, 40, 60, 5), labels)
    with pytest.raises(InputError, match="60×40 but the image is 61×40"):
        read_labels(path, 40, 61, 5)
    with pytest.raises(InputError, match="one 8-bit channel"):
        read_labels(saved("colour.png"), 40, 60, 5)
    with pytest.raises(InputError, match=r"holds the label 4; labels are 0 to 3"):
        read_labels(path, 40, 60, 4)


@pytest.fixture
def decoded(monkeypatch):
    """The files that were decoded; every file counts as written long ago."""
    names, decode = [], images._decoded
    monkeypatch.setattr(images, "_decoded", lambda path: names.append(path.name) or decode(path))
    monkeypatch.setattr(images, "SETTLED", -(10**18))
    monkeypatch.setattr(images, "_last", {})
    return names


def test_the_last_image_alone_is_remembered(saved, decoded, monkeypatch):
    a, b = saved("a.png"), saved("b.png", picture()[::-1].copy())
    first = read_image(a)
    first[:] = 0  # whoever paints on it, paints on a copy
    again = read_image(a)
    assert np.array_equal(again, picture())
    again[:] = 0
    assert np.array_equal(read_image(a), picture())
    assert decoded == ["a.png"]
    assert np.array_equal(read_image(b), picture()[::-1])
    read_image(a)
    assert decoded == ["a.png", "b.png", "a.png"]
    monkeypatch.setattr(images, "KEPT_PIXELS", 2000)
    large = saved("large.png", picture(50, 60))
    read_image(large)
    read_image(large)
    assert decoded[3:] == ["large.png"] * 2
    assert [*images._last] == ["image"]


def test_a_file_that_changes_is_read_again(saved, decoded):
    path = saved("a.bmp")
    before = path.stat()
    read_image(path)
    saved("a.bmp", picture()[::-1].copy())
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))  # of the same size and age
    assert path.stat().st_size == before.st_size
    assert np.array_equal(read_image(path), picture()[::-1])
    other = saved("b.bmp")
    os.utime(other, ns=(before.st_atime_ns, before.st_mtime_ns))
    other.replace(path)
    assert np.array_equal(read_image(path), picture())
    path.unlink()
    with pytest.raises(InputError, match="no such image"):
        read_image(path)


def test_a_file_just_written_is_not_remembered(saved, monkeypatch):
    monkeypatch.setattr(images, "_last", {})
    path = saved("a.bmp")
    read_image(path)
    assert images._last == {}  # a second change might have the time of the first
