"""The shipped models: what they say of themselves, that the wheel has them, and what they do in an unseen campus."""

import ast
import json
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
from hatchling.builders.wheel import WheelBuilder

import fdslam
from experiments.train.deeplabv3plus import labelled, stretched
from experiments.train.export import Runner
from experiments.train.measure import box_iou, confusion, iou, merged_iou
from experiments.train.views import CLASSES, HEIGHT, LOOP, TEST, TRAINING, VALIDATION, WIDTH, FramedWorld, joined
from experiments.train.yolo import boxes_of, letterboxed
from fdslam.data.campus import SESSIONS
from fdslam.data.campus.objects import KINDS
from fdslam.types import LABELS

WEIGHTS = Path(fdslam.__file__).parent / "weights"
YOLO, MASK = WEIGHTS / "yolo_campus.onnx", WEIGHTS / "deeplabv3plus_campus.onnx"
UNSEEN = 5000  # a campus that was neither trained on nor looked at
LARGE = 30  # pixels: root of the area


@pytest.fixture(scope="module")
def views():
    assert UNSEEN not in (*TRAINING, *VALIDATION, *TEST)
    world = FramedWorld(UNSEEN, LOOP * len(SESSIONS), WIDTH, HEIGHT)
    return joined([world.framed("SU", k) for k in (14, 26, 32, 44, 50, 56)])  # the first is indoors


def session(path: Path) -> onnxruntime.InferenceSession:
    return onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])


def test_all_shipped_files_together_are_small():
    assert sum(p.stat().st_size for p in WEIGHTS.rglob("*") if p.is_file()) < 6e6


def test_the_wheel_has_the_models_and_their_cards():
    root = Path(__file__).parents[2]
    shipped = {f.distribution_path for f in WheelBuilder(str(root)).recurse_included_files()}
    for name in ("yolo_campus", "deeplabv3plus_campus"):
        assert {f"fdslam/weights/{name}.onnx", f"fdslam/weights/{name}.md"} <= shipped


@pytest.mark.parametrize("path", [YOLO, MASK], ids=lambda p: p.stem)
def test_a_card_says_what_the_model_knows_and_how_it_was_made(path):
    card = path.with_suffix(".md").read_text()
    assert "knows only the embedded world" in card
    for word in ("python -m experiments.train.", "seed", "onnxruntime against torch", "WI", "SP", "SU", "AU"):
        assert word in card, word


def test_the_detector_is_a_yolox_head():
    run = session(YOLO)
    (x,), (y,) = run.get_inputs(), run.get_outputs()
    says = run.get_modelmeta().custom_metadata_map
    _, channels, height, width = x.shape
    strides = json.loads(says["fdslam.strides"])
    assert (x.type, channels, says["fdslam.layout"]) == ("tensor(float)", 3, "yolox")
    assert (says["fdslam.channels"], says["fdslam.white"], says["fdslam.placement"]) == ("bgr", "255", "corner")
    assert y.shape == [1, sum((height // s) * (width // s) for s in strides), 5 + len(CLASSES)]
    assert ast.literal_eval(says["names"]) == dict(enumerate(CLASSES))
    assert set(KINDS) <= set(CLASSES)
    out = run.run(None, {x.name: np.full(x.shape, 114, np.float32)})[0]
    assert out[..., 4:].min() >= 0
    assert out[..., 4:].max() <= 1
    assert (out[..., 4] * out[..., 5:].max(2)).max() < 0.25  # nothing is there


def test_the_segmentation_names_our_labels():
    run = session(MASK)
    (x,), (y,) = run.get_inputs(), run.get_outputs()
    says = run.get_modelmeta().custom_metadata_map
    assert (x.type, x.shape, y.shape) == ("tensor(float)", [1, 3, 512, 512], [1, len(LABELS), 512, 512])
    assert ast.literal_eval(says["names"]) == dict(enumerate(LABELS))


@pytest.mark.parametrize("path", [YOLO, MASK], ids=lambda p: p.stem)
def test_threads_change_nothing_that_matters(path, views):
    x = letterboxed(views.images[0])[0] if path == YOLO else stretched(views.images[0])
    one, two = (Runner.of_file(path, threads)(x) for threads in (1, 2))
    np.testing.assert_allclose(one, two, atol=1e-4, rtol=1e-4)


def test_the_segmentation_knows_sky_and_ground_of_an_unseen_campus(views):
    run = Runner.of_file(MASK)
    dull = LABELS.index("sky"), LABELS.index("ground")
    tables = []
    assert views.indoors.tolist() == [True] + 5 * [False]
    for image, labels, indoors in zip(views.images, views.labels, views.indoors, strict=True):
        tables.append(confusion(labels, labelled(run(stretched(image)), *labels.shape), len(LABELS)))
        assert merged_iou(tables[-1], dull) > (0.8 if indoors else 0.9)  # they are 0.88 and 0.94 to 0.98
    assert np.nanmean(iou(np.sum(tables, axis=0))) > 0.55


def test_the_detector_finds_the_large_objects_of_an_unseen_campus(views):
    run = Runner.of_file(YOLO)
    asked = got = 0
    for k, image in enumerate(views.images):
        x, ratio = letterboxed(image)
        boxes, scores, _ = boxes_of(run(x), ratio, x.shape[2:], image.shape[:2])
        assert (np.diff(scores) <= 0).all()
        _, true, clear = views.of(k)
        large = true[clear & (np.sqrt((true[:, 2:] - true[:, :2]).prod(1)) >= LARGE)]
        asked += len(large)
        got += int((box_iou(large, boxes[:11]).max(1) >= 0.5).sum()) if len(boxes) else 0
    assert asked >= 8
    assert got >= 0.45 * asked  # it is two thirds
