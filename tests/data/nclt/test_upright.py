"""What is stored as upright against numpy's rot90 of the raw image."""

import time

import numpy as np
import pytest
from PIL import Image

from fdslam.data import ledger
from fdslam.data.images import read_image
from fdslam.data.nclt import upright
from fdslam.data.nclt.upright import make_upright
from fdslam.errors import InputError
from fdslam.store import Store, sha256_file
from tests.data.worlds import texture


@pytest.fixture
def raw(tmp_path):
    files = {}
    for i in range(4):
        files[f"{i}.tiff"] = tmp_path / f"{i}.tiff"
        Image.fromarray(texture(i)).save(files[f"{i}.tiff"])
    return files


def stamps(store):
    return {path: path.stat().st_mtime_ns for path in store.root.rglob("*") if path.is_file()}


def test_images_are_turned_clockwise_without_loss(raw, tmp_path):
    frames = make_upright(raw, None, Store(tmp_path / "store"), 2)
    assert frames.keys() == raw.keys()
    for name, frame in frames.items():
        assert (frame.name, frame.height, frame.width) == (name, 160, 120)
        assert frame.digest == sha256_file(frame.path)
        assert frame.path.name.startswith(f"{raw[name].stem}-")
        np.testing.assert_array_equal(read_image(frame.path), np.rot90(read_image(raw[name]), -1))


@pytest.mark.filterwarnings("ignore::UserWarning:PIL")
@pytest.mark.parametrize("compression", ["tiff_lzw", "tiff_adobe_deflate", "packbits", "jpeg"])
def test_compressed_images_are_read_and_torn_ones_refused(tmp_path, compression):
    path = tmp_path / "5.tiff"
    Image.fromarray(texture(0)).save(path, compression=compression)
    [frame] = make_upright({"a": path}, None, Store(tmp_path / "store"), 1).values()
    np.testing.assert_array_equal(read_image(frame.path), np.rot90(np.array(Image.open(path)), -1))
    path.write_bytes(path.read_bytes()[:-4000])
    with pytest.raises(InputError, match=r"5\.tiff: (damaged|not an) image"):
        make_upright({"a": path}, None, Store(tmp_path / "store"), 1)


def test_a_second_time_nothing_is_made_or_hashed(raw, tmp_path, monkeypatch):
    monkeypatch.setattr(ledger, "SETTLED", -1)
    store = Store(tmp_path / "store")
    make_upright(raw, None, store, 1)
    first = make_upright(raw, None, store, 1)  # hashes what it made
    before = stamps(store)
    for module in (ledger, upright):
        monkeypatch.setattr(module, "read_image" if module is upright else "sha256_file", None)
    assert make_upright(raw, None, store, 3) == first
    assert stamps(store) == before


def test_what_is_damaged_or_gone_is_made_again(raw, tmp_path, monkeypatch):
    monkeypatch.setattr(ledger, "SETTLED", -1)
    store = Store(tmp_path / "store")
    first = make_upright(raw, None, store, 1)
    data = first["0.tiff"].path.read_bytes()
    first["0.tiff"].path.write_bytes(data[:-1] + b"x")
    first["1.tiff"].path.unlink()
    next((tmp_path / "store" / "upright").rglob("*.safetensors")).write_bytes(b"torn")
    assert make_upright(raw, None, store, 1) == first
    assert first["0.tiff"].path.read_bytes() == data


def test_the_undistortion_comes_before_the_turn_and_has_images_of_its_own(raw, tmp_path):
    table = tmp_path / "U2D_Cam5_1616X1232.txt"
    mirrored = [f"{r} {c} {r} {159 - c}\n" for r in range(120) for c in range(160)]
    table.write_text("width/cols = 160 , height/rows = 120\n" + "".join(mirrored))
    store = Store(tmp_path / "store")
    plain, flat = make_upright(raw, None, store, 1), make_upright(raw, table, store, 1)
    for name, frame in flat.items():
        np.testing.assert_array_equal(read_image(frame.path), np.rot90(read_image(raw[name])[:, ::-1], -1))
        assert frame.path != plain[name].path
        assert frame.digest != plain[name].digest


def test_an_image_in_portrait_is_refused_by_name(tmp_path):
    Image.fromarray(texture(0, 160, 120)).save(tmp_path / "7.tiff")
    with pytest.raises(InputError, match=r"7\.tiff: 120×160 pixels is upright already"):
        make_upright({"7.tiff": tmp_path / "7.tiff"}, None, Store(tmp_path / "store"), 1)


def test_a_half_written_image_is_refused_by_name_and_the_others_are_kept(raw, tmp_path):
    raw["2.tiff"].write_bytes(raw["2.tiff"].read_bytes()[:20_000])
    store = Store(tmp_path / "store")
    with pytest.raises(InputError, match=r"2\.tiff: damaged image"):
        make_upright(raw, None, store, 1)
    assert len(list((store.root / "upright_images").rglob("*.png"))) >= 2


def test_no_room_is_told_before_the_work(raw, tmp_path, monkeypatch):
    monkeypatch.setattr(upright.shutil, "disk_usage", lambda _: type("Usage", (), {"free": 1000}))
    with pytest.raises(InputError, match=r"4 upright images may take up to 0\.00023 GB, 1e-06 GB are free.*store=DIR"):
        make_upright(raw, None, Store(tmp_path / "store"), 1)


def test_a_real_size_image_and_table(tmp_path):
    """1616×1232 as the Ladybug3 gives them, and a table of two million lines as it is published."""
    raw = texture(3, 1232, 1616)
    Image.fromarray(raw).save(tmp_path / "1326030972000000.tiff")
    table = tmp_path / "U2D_Cam5_1616X1232.txt"
    line = "".join(f"ROW {column} SOURCE {column * 0.9 + 60.5:.6f}\n" for column in range(1616))
    with table.open("w") as file:
        file.write("width/cols = 1616 , height/rows = 1232\n")
        file.writelines(
            line.replace("ROW", str(row)).replace("SOURCE", f"{row * 0.9 + 40.25:.6f}") for row in range(1232)
        )
    start = time.monotonic()
    [frame] = make_upright({"a": tmp_path / "1326030972000000.tiff"}, table, Store(tmp_path / "store"), 1).values()
    print(f"one image with its table: {time.monotonic() - start:.1f} s, PNG {frame.path.stat().st_size / 1e6:.1f} MB")
    assert (frame.height, frame.width) == (1616, 1232)
    image = read_image(frame.path)
    for row, column in ((0, 0), (700, 900), (1231, 1615), (300, 20)):  # of the undistorted raw image
        y, x = row * 0.9 + 40.25, column * 0.9 + 60.5
        y0, x0 = int(y), int(x)
        corners = raw[y0 : y0 + 2, x0 : x0 + 2].astype(float)
        expected = np.einsum("ijk,i,j->k", corners, [1 - (y - y0), y - y0], [1 - (x - x0), x - x0])
        np.testing.assert_allclose(image[column, 1231 - row], expected, atol=4)  # remap counts in 1/32 pixels
