"""Files of BING filters: what is written is read again, what is damaged is refused in one line."""

import gzip
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save_file

from fdslam.errors import InputError
from fdslam.obb.bing import OWN, Filters, digest, load_filters, own_filters, proposals, save_filters
from fdslam.obb.bing.binary import binarise, score_map
from fdslam.obb.bing.filters import SIZES
from fdslam.obb.bing.gradient import normed_gradient
from tests.reference import bing as reference

PUBLISHED = Path(__file__).parents[3] / "shared" / "data" / "models" / "bing"
needs_published = pytest.mark.skipif(not PUBLISHED.is_dir(), reason=f"no published BING filters at {PUBLISHED}")
NAME = "ObjNessB2W8MAXBGR"


def filters(space="maxbgr", seed=0, sizes=(0, 7, 14)):
    rng = np.random.default_rng(seed)
    first, second = rng.normal(0, 1e-3, (8, 8)), rng.normal(0, 1, (len(sizes), 2))
    return Filters(space, first.astype(np.float32), np.array(sizes, np.int32), second.astype(np.float32))


def same(one, other):
    return one.space == other.space and all(
        np.array_equal(getattr(one, name), getattr(other, name)) for name in ("first", "sizes", "second")
    )


def yaml(name, matrix, kind):
    data = ", ".join(f"{value:.9g}" for value in np.ravel(matrix))
    rows, columns = np.shape(matrix)
    return (
        f"%YAML:1.0\n{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: {kind}\n   data: [ {data} ]\n"
    )


def publish(folder, one, name=NAME):
    parts = {"wS1": (one.first, "f"), "wS2": (one.second, "f"), "idx": (one.sizes[:, None], "i")}
    for part, (matrix, kind) in parts.items():
        (folder / f"{name}.{part}.yml.gz").write_bytes(gzip.compress(yaml(name, matrix, kind).encode()))
    return folder / name


def refused(path):
    with pytest.raises(InputError) as caught:
        load_filters(path)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message or path.name in message
    return message


def test_own_format(tmp_path):
    several = (filters("hsv", 1), filters("maxbgr", 2, range(36)))
    save_filters(tmp_path / "a.safetensors", several)
    again = load_filters(str(tmp_path / "a.safetensors"))
    assert len(again) == 2
    assert all(map(same, several, again))
    assert digest(again) == digest(several) != digest(several[:1])
    save_filters(tmp_path / "b.safetensors", again)
    assert (tmp_path / "a.safetensors").read_bytes() == (tmp_path / "b.safetensors").read_bytes()


def test_published_format(tmp_path):
    one, other = filters("maxbgr", 3), filters("grey", 4)
    prefix = publish(tmp_path, one)
    publish(tmp_path, other, "ObjNessB2W8I")
    assert same(load_filters(prefix)[0], one)
    assert all(map(same, load_filters(tmp_path), (one, other)))
    assert digest(load_filters(prefix)) == digest([one])


def test_damaged_own_file(tmp_path):
    path = tmp_path / "a.safetensors"
    assert "no such file" in refused(path)
    save_filters(path, [filters()])
    whole = path.read_bytes()
    for damaged, word in ((whole[:100], "safetensors"), (b"", "safetensors"), (whole[:-3] + b"abc", "damaged|wrong")):
        path.write_bytes(damaged)
        assert any(w in refused(path) for w in word.split("|"))
    save_file({"weights": np.zeros(3, np.float32)}, path)
    assert "not of BING" in refused(path)


@pytest.mark.parametrize("part", ["wS1", "wS2", "idx"])
def test_damaged_published_file(tmp_path, part):
    prefix = publish(tmp_path, filters())
    path = tmp_path / f"{NAME}.{part}.yml.gz"
    whole = path.read_bytes()

    def refusal():
        with pytest.raises(InputError) as caught:
            load_filters(prefix)
        assert "\n" not in str(caught.value)
        return str(caught.value)

    for damaged in (whole[: len(whole) // 2], b"no gzip", b"", whole[:30] + b"\0\0\0" + whole[33:]):
        path.write_bytes(damaged)
        assert path.name in refusal()
    for text in ("", "%YAML:1.0\n", yaml(NAME, [[1, 2]], "f").replace("2 ]", "x ]"), "a: 1", yaml(NAME, [[1]], "u")):
        path.write_bytes(gzip.compress(text.encode()))
        assert "OpenCV matrix" in refusal()
    path.write_bytes(gzip.compress(yaml(NAME, [[1, 2, 3, 4, 5]], "f").encode()))
    assert "do not fit together" in refusal()
    path.write_bytes(gzip.compress(b" " * 2_000_000))
    assert "OpenCV matrix" in refusal()
    path.unlink()
    assert f"{path}: no such file" in refusal()


def test_nothing_there(tmp_path):
    assert "no BING filters" in refused(tmp_path / "nothing")
    assert "holds no BING filters" in refused(tmp_path)
    publish(tmp_path, filters(), "Other")
    assert "ends in MAXBGR, HSV, I" in refused(tmp_path / "Other")


@pytest.mark.parametrize(
    "change",
    [
        {"space": "rgb"},
        {"first": np.zeros((8, 8), np.float32)},
        {"first": np.full((8, 8), np.nan, np.float32)},
        {"first": np.ones((7, 8), np.float32)},
        {"sizes": np.array([0, 7, 7], np.int32)},
        {"sizes": np.array([0, 7, 36], np.int32)},
        {"sizes": np.array([-1, 7, 8], np.int32)},
        {"sizes": np.array([], np.int32)},
        {"second": np.ones((2, 2), np.float32)},
        {"second": np.full((3, 2), np.inf, np.float32)},
    ],
)
def test_what_cannot_be_filters_is_refused(change):
    good = filters()
    fields = {"space": good.space, "first": good.first, "sizes": good.sizes, "second": good.second}
    with pytest.raises(InputError, match="BING filters"):
        Filters(**{**fields, **change})


def test_each_space_once(tmp_path):
    for several in ([], [filters(), filters()]):
        with pytest.raises(InputError, match="each colour space once"):
            save_filters(tmp_path / "a.safetensors", several)


def test_own_filters_are_in_the_package():
    assert OWN.is_file()
    assert OWN.stat().st_size < 10_000
    assert OWN.with_suffix(".md").is_file()  # the card
    assert len(own_filters()[0].sizes) >= 10
    assert digest(own_filters()) in OWN.with_suffix(".md").read_text(encoding="utf-8")


@needs_published
def test_published_filters_give_the_known_binary_filter():
    one = load_filters(PUBLISHED / NAME)[0]
    beta, signs = binarise(one.first)
    assert beta == pytest.approx([1.649e-4, 1.146e-4], abs=5e-8)
    assert [int(a) for a in signs] == [0x7EFFFFE3C3EFE75A, 0x7E7E42DF7E521824]
    left_out = [(16, 128), (16, 256), (16, 512), (32, 256), (32, 512), (256, 16), (512, 16), (512, 32)]
    assert [size for size in SIZES if size not in left_out] == [SIZES[i] for i in one.sizes]


@needs_published
def test_published_filters_in_three_spaces_score_as_the_oracle():
    found = load_filters(PUBLISHED)
    assert [one.space for one in found] == ["maxbgr", "hsv", "grey"]
    image = np.random.default_rng(0).integers(0, 256, (26, 31, 3), dtype=np.uint8)
    image[8:20, 6:22] //= 3
    for one in found:
        scores = score_map(normed_gradient(image, one.space), *binarise(one.first))
        assert np.array_equal(scores, reference.score_map(reference.gradient(image, one.space), one.first))
    boxes, scores = proposals(image, found, 300)
    told = [
        (f.space, f.first, {SIZES[i]: tuple(map(float, r)) for i, r in zip(f.sizes, f.second, strict=True)})
        for f in found
    ]
    expected = reference.proposals(image, told, 300)
    assert scores.tolist() == [float(score) for score, _ in expected]
    assert boxes.tolist() == [list(box) for _, box in expected]
