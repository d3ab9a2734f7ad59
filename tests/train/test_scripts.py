"""Both trainings, on a handful of small views, end and export a model that onnxruntime runs; and the export itself."""

import numpy as np
import onnx
import pytest
import torch
from torch import nn

from experiments.train import deeplabv3plus, export, masks, views, yolo
from experiments.train.networks import DeepLabV3Plus, Detector
from experiments.train.views import CLASSES
from fdslam.types import LABELS

SMOKE = "--threads 1 --seeds 7 --validation 7 --test 7 --every 48 --height 96 --width 72 --batch 2"


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return tmp_path_factory.mktemp("train")


@pytest.mark.filterwarnings("ignore::FutureWarning", "ignore::DeprecationWarning", "ignore::UserWarning")
@pytest.mark.parametrize("script", [yolo, deeplabv3plus], ids=lambda s: s.__name__.rpartition(".")[2])
def test_a_training_ends_and_exports(script, store, capsys, monkeypatch):
    for module in (views, script):
        monkeypatch.setattr(module, "SESSIONS", ("SU", "WI"))
    rounds = 3 if script is yolo else 2
    arguments = [*SMOKE.split(), "--store", str(store), "--out", str(store), "--epochs", *["1"] * rounds]
    script.main(arguments)
    printed = capsys.readouterr().out
    assert printed.count("epoch 0:") == rounds
    assert "onnxruntime against torch: at most" in printed
    assert "| all (4) |" in printed
    path = store / f"{script.NAME}.onnx"
    model = onnx.load(path)
    assert {p.key for p in model.metadata_props} >= {"names", "fdslam.layout", "fdslam.domain"}
    large = [t for t in model.graph.initializer if np.prod(t.dims) >= export.SMALL]
    assert {t.data_type for t in large if t.data_type == onnx.TensorProto.FLOAT} == set()  # kept in 16 bits
    before = path.read_bytes()
    if script is deeplabv3plus:
        script.main([*arguments, "--done", str(rounds)])
        assert path.read_bytes() == before


def test_masks_are_counted_in_pixels(monkeypatch):
    labels = np.zeros((9, 4, 6), np.uint8)  # all sky
    labels[0, :, :2] = LABELS.index("building")
    one = views.Views(np.zeros((9, 4, 6, 3), np.uint8), labels, *[np.zeros(0)] * 5)
    seen = np.full((4, 6), LABELS.index("building"), np.uint8)
    seen[:, :3] = LABELS.index("ground")  # half of what is seen, a third of which is not there
    model = type("Model", (), {"labels": lambda self, image: seen})()
    assert masks.overlap(model, one) == (4 + 12, 24 + 24)  # of the first and the last of nine views


def test_networks_say_something_of_every_cell_and_pixel():
    assert Detector(len(CLASSES)).eval()(torch.zeros(1, 3, 64, 96)).shape == (1, 96 + 24 + 6, 5 + len(CLASSES))
    assert DeepLabV3Plus(len(LABELS)).eval()(torch.zeros(1, 3, 64, 96)).shape == (1, len(LABELS), 64, 96)


def test_folding_changes_nothing():
    torch.manual_seed(0)
    net = Detector(3)
    with torch.no_grad():
        for _ in range(3):
            net(torch.rand(4, 3, 64, 64) * 255)  # the batch norms see something
    net.eval()
    x = torch.rand(1, 3, 64, 64) * 255
    plain = export.folded(net)
    assert not any(isinstance(m, nn.BatchNorm2d) for m in plain.modules())
    torch.testing.assert_close(plain(x), net(x), rtol=1e-3, atol=1e-4)


def test_an_export_that_differs_is_refused(tmp_path, monkeypatch):
    class Loud(nn.Module):
        def forward(self, x: torch.Tensor) -> torch.Tensor:
            return x * 2

    monkeypatch.setattr(export.Runner, "of_network", staticmethod(lambda net: lambda x: x * 2.1))
    with pytest.raises(ValueError, match="differs from torch"):
        export.export(Loud(), [np.ones((1, 3, 4, 4), np.float32)], tmp_path / "a.onnx", "x", "y", {})


@pytest.mark.parametrize(("height", "width", "left"), [(404, 308, (416, 317)), (200, 400, (160, 320))])
def test_a_letterbox_keeps_the_shape_in_the_top_left(height, width, left):
    image = np.zeros((height, width, 3), np.uint8)
    image[..., 0] = 200  # red
    x, ratio = yolo.letterboxed(image)
    inside = x[0, 2] == 200
    assert x.shape == (1, 3, 416, 320)
    assert (np.count_nonzero(inside.any(1)), np.count_nonzero(inside.any(0))) == left
    assert inside[: left[0], : left[1]].all()
    assert (x[0, :, left[0] :] == 114).all()
    assert ratio == pytest.approx(min(416 / height, 320 / width))


def test_boxes_come_back_from_where_they_were_put():
    raw = np.full((1, 4 * 6 + 2 * 3 + 1 * 1, 5 + 2), -3, np.float32)  # 32 × 48: grids of 4 × 6, 2 × 3 and 1 × 1
    raw[..., 4:] = 0
    raw[0, 6 + 2] = 0.5, 0.25, np.log(2), 0, 0.9, 0.1, 0.8  # row 1, column 2 of stride 8
    raw[0, 6 + 3] = -0.5, 0.25, np.log(2), 0, 0.8, 0.1, 0.8  # the same box
    boxes, scores, kinds = yolo.boxes_of(raw, 0.5, (32, 48), (64, 96))
    assert boxes.tolist() == [[24, 12, 56, 28]]
    assert scores.tolist() == pytest.approx([0.72])
    assert kinds.tolist() == [1]
