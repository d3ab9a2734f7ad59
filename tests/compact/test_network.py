"""Oracle: the whole model, run with its inner layers as outputs."""

import numpy as np
import onnxruntime
import pytest

from fdslam.compact.network import NetworkFeatures, truncated
from fdslam.compact.sources import load_source
from fdslam.config import Compact, Config, Dense, Obb
from fdslam.config import Yolo as Settings
from fdslam.errors import InputError
from fdslam.obb.yolo import Yolo
from fdslam.obb.yolo.letterbox import GREY
from tests.compact.networks import CHANNELS, LAYERS, with_backbone, with_outputs
from tests.data.worlds import texture


def source(path, **changes):
    return NetworkFeatures(Dense(**changes), Yolo(Settings(weights=str(path))), 1)


def whole(path, fed):
    """What the layers of the whole model hold for an input, float32 [1, 3, H, W]: [rows, cols, channels] each."""
    session = onnxruntime.InferenceSession(with_outputs(path, LAYERS), providers=["CPUExecutionProvider"])
    return [layer[0].transpose(1, 2, 0) for layer in session.run(None, {session.get_inputs()[0].name: fed})]


def planes(tile, channels, white):
    ordered = tile[..., ::-1] if channels == "bgr" else tile
    return (ordered.astype(np.float32) * np.float32(white / 255)).transpose(2, 0, 1)[None]


@pytest.mark.parametrize(("layout", "channels", "white"), [("yolox", "bgr", 255), ("yolov8", "rgb", 1)])
@pytest.mark.parametrize("size", [(64, 64), (64, 96), (96, 64)])
def test_features_are_those_inside_the_whole_model(tmp_path, layout, channels, white, size):
    path = with_backbone(tmp_path / "net.onnx", layout, *size)
    image = texture(1, *size)
    fine, coarse = source(path).describe(image)
    assert fine.shape == (size[0] // 8, size[1] // 8, CHANNELS[8])
    assert coarse.shape == (size[0] // 16, size[1] // 16, CHANNELS[16])
    for found, expected in zip((fine, coarse), whole(path, planes(image, channels, white)), strict=True):
        assert found.dtype == np.float32
        assert np.allclose(found, expected, rtol=1e-5, atol=1e-5)
        assert np.abs(found).max() > 0.01


def test_an_input_of_any_size_and_one_with_channels_last(tmp_path):
    image = texture(2, 64, 64)
    fixed = source(with_backbone(tmp_path / "a.onnx")).describe(image)
    last = source(with_backbone(tmp_path / "b.onnx", planar=False)).describe(image)
    detector = Yolo(Settings(weights=str(with_backbone(tmp_path / "c.onnx", dynamic=True)), side=64))
    free = NetworkFeatures(Dense(), detector, 1).describe(image)
    for one, two, three in zip(fixed, last, free, strict=True):
        assert np.allclose(one, two, atol=1e-5)
        assert np.allclose(one, three, atol=1e-5)


def test_the_image_lies_in_the_corner_on_grey(tmp_path):
    path = with_backbone(tmp_path / "net.onnx")
    image = texture(3, 48, 64)
    drawn = np.full((64, 64, 3), GREY, np.uint8)
    drawn[:48] = image
    looks = source(path)
    for found, expected, grid in zip(
        looks.describe(image), whole(path, planes(drawn, "bgr", 255)), looks.grids(48, 64), strict=True
    ):
        assert found.shape[:2] == (grid.rows, grid.cols)
        assert np.allclose(found, expected[: grid.rows, : grid.cols], atol=1e-5)
        assert grid.step_x == grid.step_y == 64 / expected.shape[0]


@pytest.mark.parametrize("size", [(64, 200), (200, 64), (30, 150), (170, 50)])
def test_each_cell_is_what_one_of_the_tiles_says_of_it(tmp_path, size):
    path, image = with_backbone(tmp_path / "net.onnx"), texture(4, *size)
    looks = source(path)
    canvas = looks._canvas(*size)
    drawn = canvas.draw(image)
    assert len(canvas.tops) * len(canvas.lefts) > 1
    tiles = {
        (top, left): whole(path, planes(drawn[top : top + 64, left : left + 64], "bgr", 255))
        for top in canvas.tops
        for left in canvas.lefts
    }
    for level, (stride, found, grid) in enumerate(zip((8, 16), looks.describe(image), looks.grids(*size), strict=True)):
        assert found.shape[:2] == (grid.rows, grid.cols)
        for row in range(grid.rows):
            for col in range(grid.cols):
                seen = []  # how far from its tile's border a cell is, and what the tile says
                for (top, left), layers in tiles.items():
                    y, x, n = row - top // stride, col - left // stride, 64 // stride
                    if 0 <= y < n and 0 <= x < n:
                        seen.append((min(x, y, n - 1 - x, n - 1 - y), layers[level][y, x]))
                deepest = max(depth for depth, _ in seen)
                assert any(
                    np.allclose(found[row, col], value, atol=1e-5) for depth, value in seen if depth == deepest
                ), (row, col)


@pytest.mark.parametrize(("until", "stride"), [(16, 16), (8, 8), (2, 8)])
def test_a_model_without_the_strides_is_refused(tmp_path, until, stride):
    path = with_backbone(tmp_path / "net.onnx", until=until)
    message = rf"no convolution of it goes from stride {stride} to {2 * stride}.*compact\.source=gradients"
    with pytest.raises(InputError, match=message) as error:
        source(path)
    assert "\n" not in str(error.value)
    assert str(path) in str(error.value)
    with pytest.raises(InputError, match="here: no convolution"):
        truncated(path.read_bytes(), 64, 64, "here")


def test_a_layer_that_the_model_puts_out_itself_is_found_too(tmp_path):
    path = with_backbone(tmp_path / "net.onnx")
    for outputs in (("a8",), ("a16",), LAYERS, ("cs16", "cs32")):
        assert truncated(with_outputs(path, outputs), 64, 64, "here")[1] == LAYERS


def test_what_is_not_finite_is_refused(tmp_path):
    looks = source(with_backbone(tmp_path / "net.onnx"))

    class Broken:
        def run(self, *_):
            return [np.full((1, 6, 8, 8), np.nan, np.float32), np.zeros((1, 7, 4, 4), np.float32)]

    looks.session = Broken()
    with pytest.raises(InputError, match="not finite"):
        looks.describe(texture(0, 64, 64))


def test_the_layers_and_the_bytes_are_part_of_the_identity(tmp_path):
    path = with_backbone(tmp_path / "net.onnx")
    looks = source(path)
    assert looks.layers == LAYERS
    assert looks.identity["layers"] == list(LAYERS)
    assert looks.identity != source(path, kilobytes=5).identity
    assert looks.identity == source(path).identity


def test_the_source_is_the_one_the_configuration_names(tmp_path):
    one, two = (with_backbone(tmp_path / f"{name}.onnx", height=h) for name, h in (("a", 64), ("b", 96)))
    plain = Config(obb=Obb("J+B+YOLO", yolo=Settings(weights=str(one))))
    assert load_source(plain).detector.height == 64
    assert load_source(Config(obb=plain.obb, compact=Compact(weights=str(two)))).detector.height == 96
    assert load_source(Config(compact=Compact(source="gradients"))).identity["source"] == "gradients"
    with pytest.raises(InputError, match="no such file"):
        load_source(Config(compact=Compact(weights=str(tmp_path / "none.onnx"))))
