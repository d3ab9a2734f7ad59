"""Detectors that find what is painted, in every layout; and a real one where it is there."""

import io
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fdslam import onnx_model
from fdslam.config import Yolo as Settings
from fdslam.data.images import read_image
from fdslam.errors import InputError
from fdslam.obb.yolo import Yolo
from tests.onnx_models import COLOURS, colour_finder, constant

SHARED = Path(__file__).parents[4] / "shared" / "data"
NANO = SHARED / "models" / "yolox_nano.onnx"
LAYOUTS = ["yolox", "yolov5", "yolov8"]
RED, GREEN, BLUE = range(3)


def painted(height, width, boxes):
    """Return a black image with rectangles: (colour, x0, y0, x1, y1)."""
    image = np.zeros((height, width, 3), np.uint8)
    for colour, x0, y0, x1, y1 in boxes:
        image[y0:y1, x0:x1, colour] = 255
    return image


def named(layout, **more):
    """The classes of a finder are its channels, which YOLOX takes from blue to red."""
    order = COLOURS[::-1] if layout == "yolox" else COLOURS
    return {"names": str(dict(enumerate(order))), **more}


def finder(path, layout, settings=None, **changes):
    colour_finder(path, layout, metadata=named(layout), **changes)
    return Yolo(settings or Settings(weights=str(path), score=0.9, count=1000))


@pytest.mark.parametrize("layout", LAYOUTS)
def test_what_is_painted_is_found_where_it_is(layout, tmp_path):
    yolo = finder(tmp_path / "m.onnx", layout)
    image = painted(64, 64, [(RED, 0, 0, 8, 8), (BLUE, 32, 16, 48, 32), (GREEN, 32, 32, 64, 64)])
    found = yolo.detect(image)
    seen = {(yolo.names[k], *box) for k, box in zip(found.label, found.xyxy.tolist(), strict=True)}
    # A cell of stride 16 is found as one, and its four cells of stride 8 too: each overlaps it by a quarter.
    assert {("red", 0, 0, 8, 8), ("blue", 32, 16, 48, 32), ("green", 32, 32, 64, 64)} <= seen
    assert {name for name, *_ in seen} == set(COLOURS)
    assert yolo.head.layout == layout
    assert found.xyxy.dtype == np.float32


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize(("height", "width"), [(128, 256), (100, 40), (33, 61)])
def test_boxes_come_back_from_the_letterbox(layout, height, width, tmp_path):
    yolo = finder(tmp_path / "m.onnx", layout, Settings(weights=str(tmp_path / "m.onnx"), score=0.9, tile="never"))
    placed = yolo_letterbox(yolo, height, width)
    # A square that fills a cell of stride 8 of the canvas, painted on the image: scaled, it fills that cell again.
    x0 = placed.left + (-placed.left) % 8
    y0 = placed.top + (-placed.top) % 8
    cell = np.array([[x0, y0, x0 + 8, y0 + 8]], float)
    [expected] = placed.back(cell)
    image = np.zeros((height, width, 3), np.uint8)
    left, top, right, bottom = np.array([np.floor(expected[:2]), np.ceil(expected[2:])]).ravel().astype(int)
    image[top:bottom, left:right, RED] = 255
    found = yolo.detect(image)
    assert any(np.abs(box - expected).max() < 1e-3 for box in found.xyxy)


def yolo_letterbox(yolo, height, width):
    from fdslam.obb.yolo.letterbox import letterbox

    return letterbox(height, width, yolo.height, yolo.width, yolo.input[2])


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("changes", [{"dynamic": True}, {"planar": False}])
def test_other_inputs_find_the_same(layout, changes, tmp_path):
    image = np.random.default_rng(0).integers(0, 256, (64, 64, 3)).astype(np.uint8)
    image[16:32, 16:32] = [250, 20, 20]
    settings = Settings(weights=str(tmp_path / "m.onnx"), score=0.5, side=64)
    plain = finder(tmp_path / "m.onnx", layout, settings).detect(image)
    other = finder(tmp_path / "m.onnx", layout, settings, **changes).detect(image)
    assert len(plain.score) > 0
    assert np.array_equal(plain.xyxy, other.xyxy)
    assert np.array_equal(plain.score, other.score)


def test_channels_white_and_placement_as_told(tmp_path):
    image = painted(64, 64, [(RED, 0, 0, 32, 32)])
    path = tmp_path / "m.onnx"
    colour_finder(path, "yolov8", white=255.0)
    assert Yolo(Settings(weights=str(path), score=0.9)).input == ("rgb", 1.0, "centre")
    assert len(Yolo(Settings(weights=str(path), score=0.9)).boxes(image)) == 0  # all but black to it
    found = Yolo(Settings(weights=str(path), score=0.9, white=255, channels="bgr")).detect(image)
    assert set(found.label.tolist()) == {2}
    tall = painted(64, 32, [(GREEN, 0, 0, 32, 32)])
    lying = {p: Yolo(Settings(weights=str(path), white=255, placement=p)).input[2] for p in ("corner", "centre")}
    assert lying == {"corner": "corner", "centre": "centre"}
    corner = Yolo(Settings(weights=str(path), score=0.9, white=255, placement="corner", tile="never"))
    assert [0, 0, 8, 8] in corner.boxes(tall).tolist()


def test_what_the_metadata_say_is_done_unless_the_configuration_says_more(tmp_path):
    says = {"fdslam.white": "255", "fdslam.channels": "bgr", "fdslam.placement": "corner"}
    path = colour_finder(tmp_path / "m.onnx", "yolov8", white=255.0, metadata=says)
    assert Yolo(Settings(weights=str(path))).input == ("bgr", 255.0, "corner")
    told = Settings(weights=str(path), white=2, channels="rgb", placement="centre")
    assert Yolo(told).input == ("rgb", 2.0, "centre")
    colour_finder(path, "yolov8", metadata={"fdslam.channels": "yuv"})
    with pytest.raises(InputError, match=r"metadata say fdslam\.channels=yuv; known are rgb, bgr"):
        Yolo(Settings(weights=str(path)))


def test_only_the_chosen_classes(tmp_path):
    path = tmp_path / "m.onnx"
    image = painted(64, 64, [(RED, 0, 0, 32, 32), (BLUE, 32, 32, 64, 64)])
    for wanted, labels in ((["red"], {0}), (["2"], {2}), ([], {0, 2}), (["green"], set())):
        found = finder(path, "yolov8", Settings(weights=str(path), score=0.9, count=1000, classes=wanted)).detect(image)
        assert set(found.label.tolist()) == labels


def test_at_most_so_many_and_the_best(tmp_path):
    path = tmp_path / "m.onnx"
    image = np.zeros((64, 64, 3), np.uint8)
    levels = np.linspace(130, 255, 64).astype(np.uint8).reshape(8, 8)
    image[..., RED] = np.kron(levels, np.ones((8, 8), np.uint8))
    finder(path, "yolov8")
    found = {n: Yolo(Settings(weights=str(path), score=0.5, count=n)).detect(image) for n in (3, 11, 1000)}
    assert [len(f.score) for f in found.values()] == [3, 11, 64 + 16 + 4]
    assert np.array_equal(found[3].xyxy, found[1000].xyxy[:3])
    assert (np.diff(found[1000].score) <= 0).all()


def test_nothing_found_is_no_box(tmp_path):
    found = finder(tmp_path / "m.onnx", "yolox").detect(np.zeros((50, 70, 3), np.uint8))
    assert found.xyxy.shape == (0, 4)
    assert found.xyxy.dtype == np.float32


def test_a_wide_image_is_looked_at_in_tiles(tmp_path):
    path = tmp_path / "m.onnx"
    image = painted(64, 256, [(RED, 128, 8, 136, 16)])
    whole = finder(path, "yolov8", Settings(weights=str(path), score=0.9, tile="never")).boxes(image)
    tiled = finder(path, "yolov8", Settings(weights=str(path), score=0.9)).boxes(image)
    assert len(whole) == 0  # 8 pixels of 256 are 2 of the canvas
    assert len(tiled) > 0
    assert (np.abs(tiled - [128, 8, 136, 16]) <= 8).all()


@pytest.mark.parametrize("layout", LAYOUTS)
def test_an_image_smaller_than_a_tile_and_a_very_small_one(layout, tmp_path):
    path = tmp_path / "m.onnx"
    settings = Settings(weights=str(path), score=0.9, tile="always", tile_side=500)
    found = finder(path, layout, settings).detect(painted(16, 16, [(GREEN, 0, 0, 16, 16)]))
    assert [0, 0, 16, 16] in np.round(found.xyxy).tolist() or (found.xyxy >= 0).all()
    assert len(found.score) > 0
    assert (found.xyxy[:, 2:] <= 16).all()


def test_boxes_stay_inside_the_image(tmp_path):
    path = tmp_path / "m.onnx"
    image = painted(40, 64, [(RED, 0, 0, 64, 40)])
    found = finder(path, "yolox", Settings(weights=str(path), score=0.3, count=1000), size=5.0).detect(image)
    assert (found.xyxy >= 0).all()
    assert (found.xyxy <= [64, 40, 64, 40]).all()
    assert (found.xyxy[:, 2:] - found.xyxy[:, :2] >= 1).all()


def test_a_grey_image_is_one_of_three_equal_channels_and_16_bit_is_refused(tmp_path):
    yolo = finder(tmp_path / "m.onnx", "yolov8")
    grey = np.zeros((64, 64), np.uint8)
    grey[16:32, 16:32] = 255
    Image.fromarray(grey).save(tmp_path / "grey.png")
    Image.fromarray(np.repeat(grey[..., None], 3, axis=2)).save(tmp_path / "rgb.png")
    found = [yolo.boxes(read_image(tmp_path / f"{name}.png")) for name in ("grey", "rgb")]
    assert len(found[0]) > 0
    assert np.array_equal(*found)
    data = io.BytesIO()
    Image.fromarray(grey.astype(np.uint16) * 257).save(data, "png")
    (tmp_path / "deep.png").write_bytes(data.getvalue())
    with pytest.raises(InputError, match=r"deep\.png: more than 8 bit a channel .* convert it to 8 bit first"):
        read_image(tmp_path / "deep.png")


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda p: colour_finder(p, "yolov8", metadata={"task": "segment"}), "metadata say task=segment"),
        (lambda p: colour_finder(p, "yolov8", metadata={"names": "['a']"}), "has 3 classes, and the model names 1"),
        (
            lambda p: colour_finder(p, "yolov8", metadata={"fdslam.layout": "ssd"}),
            r"say fdslam\.layout=ssd; known",
        ),
        (lambda p: constant(p, np.zeros((1, 100, 4)), np.zeros((1, 100))), r"outputs are \[1, 100, 4\], \[1, 100\]"),
        (lambda p: constant(p, np.zeros((1, 300, 6))), "boxes after suppression are not read"),
        (lambda p: constant(p, np.zeros((1, 1000))), r"outputs are \[1, 1000\]; expected \[1, n, 5 \+ classes\]"),
    ],
)
def test_a_model_that_is_not_understood_is_one_line(make, said, tmp_path):
    path = make(tmp_path / "m.onnx")
    with pytest.raises(InputError, match=said) as raised:
        Yolo(Settings(weights=str(path)))
    assert str(raised.value).startswith(f"obb.yolo.weights={path}: ")
    assert "\n" not in str(raised.value)


def test_a_missing_model_says_the_way_out(tmp_path):
    with pytest.raises(InputError, match=r"no such file; check the path, or fetch one: python -m fdslam\.fetch"):
        Yolo(Settings(weights=str(tmp_path / "m.onnx")))


def test_a_shipped_model_that_is_not_there_says_what_works_without(tmp_path, monkeypatch):
    monkeypatch.setattr(onnx_model, "WEIGHTS", tmp_path)
    with pytest.raises(InputError, match=r"yolo_campus\.onnx: no such file; .*fetch yolox-nano .* as obb=j_b does"):
        Yolo(Settings())


def test_a_side_that_cuts_cells(tmp_path):
    path = colour_finder(tmp_path / "m.onnx", "yolox", dynamic=True)
    with pytest.raises(InputError, match=r"obb\.yolo\.side=100: a multiple of 32 is needed"):
        Yolo(Settings(weights=str(path), side=100))


def test_identity_is_what_decides_and_nothing_else(tmp_path):
    path = str(colour_finder(tmp_path / "m.onnx", "yolov8"))
    plain = Yolo(Settings(weights=path)).identity
    same = (
        {"threads": 2},
        {"layout": "yolov8"},
        {"channels": "rgb"},
        {"white": 1.0},
        {"placement": "centre"},
        {"classes": ["2", "1", "0"]},
        {"side": 320},  # of a model that takes any
    )
    assert all(Yolo(Settings(weights=path, **one)).identity == plain for one in same)
    others = (
        {"score": 0.3},
        {"nms": 0.5},
        {"count": 5},
        {"channels": "bgr"},
        {"white": 2.0},
        {"placement": "corner"},
        {"classes": ["1"]},
        {"tile": "always"},
        {"tile_side": 99},
        {"overlap": 0.3},
    )
    assert all(Yolo(Settings(weights=path, **one)).identity != plain for one in others)
    colour_finder(path, "yolov8", size=2.0)
    assert Yolo(Settings(weights=path)).identity != plain


needs_nano = pytest.mark.skipif(not NANO.is_file(), reason=f"no real detector at {NANO}")


def street(count=6):
    return [read_image(path) for path in sorted((SHARED / "camvid_changes" / "query").glob("*.jpg"))[::27][:count]]


@needs_nano
def test_a_real_detector_finds_cars_and_people_in_a_street():
    yolo = Yolo(Settings(weights=str(NANO)))
    assert (yolo.head.layout, yolo.head.strides, yolo.input) == ("yolox", (8, 16, 32), ("bgr", 255.0, "corner"))
    found = [yolo.detect(image) for image in street()]
    assert all(1 <= len(one.score) <= 11 for one in found)
    names = [yolo.names[k] for one in found for k in one.label]
    assert {"car", "person"} <= set(names)
    assert sum(name in ("car", "person", "bus", "truck", "bicycle") for name in names) > 0.8 * len(names)


@needs_nano
def test_threads_and_company_change_nothing_of_a_real_detector():
    images = street(4)
    one, three = Yolo(Settings(weights=str(NANO))), Yolo(Settings(weights=str(NANO), threads=3))
    alone = [one.detect(image) for image in images]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(one.detect, images[::-1]))[::-1]
    more = [three.detect(image) for image in images]
    for a, b, c in zip(alone, together, more, strict=True):
        assert len(a.score) > 0
        for other in (b, c):
            assert np.array_equal(a.xyxy, other.xyxy)
            assert np.array_equal(a.score, other.score)


@needs_nano
def test_the_channels_of_a_real_detector_are_told_right():
    """In the wrong order it still finds something, only less: a mistake that no error would show."""
    images = street(6)
    scores = {
        channels: sum(Yolo(Settings(weights=str(NANO), channels=channels)).detect(i).score.sum() for i in images)
        for channels in ("bgr", "rgb")
    }
    scores["scaled"] = sum(Yolo(Settings(weights=str(NANO), white=1)).detect(i).score.sum() for i in images)
    assert scores["bgr"] > scores["rgb"] > scores["scaled"]
