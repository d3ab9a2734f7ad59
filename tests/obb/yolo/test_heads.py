import math

import numpy as np
import pytest

from fdslam.obb.yolo.heads import STRIDES, UnknownHead, grid, recognise
from tests.onnx_models import cells

HEIGHT, WIDTH = 96, 128
RNG = np.random.default_rng(0)


def raw(n=None, classes=3):
    n = n or cells(HEIGHT, WIDTH)
    return np.concatenate(
        [RNG.normal(0, 1, (n, 2)), RNG.normal(1, 0.5, (n, 2)), RNG.uniform(0, 1, (n, 1 + classes))], axis=1
    ).astype(np.float32)[None]


def decoded(n, classes=3):
    found = RNG.uniform(0, 1, (n, 5 + classes))
    found[:, :4] *= HEIGHT
    return found.astype(np.float32)[None]


def columns(n, classes=3):
    return np.delete(decoded(n, classes), 4, axis=2).transpose(0, 2, 1).copy()


def loop(head, output, least):
    """The layouts as their scripts decode them, candidate by candidate."""
    rows = output[0].T if head.layout == "yolov8" else output[0]
    cell = [
        (x, y, s) for s in head.strides for y in range(head.height // s) for x in range(head.width // s)
    ]  # empty for decoded layouts
    found = []
    for i, row in enumerate(rows):
        row = [float(value) for value in row]
        cx, cy, w, h = row[:4]
        if head.layout == "yolox":
            x, y, s = cell[i]
            cx, cy, w, h = (cx + x) * s, (cy + y) * s, math.exp(w) * s, math.exp(h) * s
        scores = row[4:] if head.layout == "yolov8" else [row[4] * score for score in row[5:]]
        best = max(range(len(scores)), key=lambda k: (scores[k], -k))
        if scores[best] >= least:
            found.append((cx - w / 2, cy - h / 2, cx + w / 2, cy + h / 2, scores[best], best))
    return found


@pytest.mark.parametrize(
    ("output", "layout"),
    [
        (raw(), "yolox"),
        (decoded(3 * cells(HEIGHT, WIDTH)), "yolov5"),
        (decoded(cells(HEIGHT, WIDTH)), "yolov5"),  # YOLOX exported with its decoding
        (columns(cells(HEIGHT, WIDTH)), "yolov8"),
    ],
)
def test_recognised_by_its_shape_and_decoded_as_the_loop_does(output, layout):
    head = recognise([output], HEIGHT, WIDTH, "")
    assert (head.layout, head.classes) == (layout, 3)
    found = head.decode(output, 0.4)
    slow = loop(head, output, 0.4)
    assert 10 < len(slow) < len(output[0].T if layout == "yolov8" else output[0])
    assert np.allclose(found.xyxy, [row[:4] for row in slow], rtol=1e-5, atol=1e-4)
    assert np.allclose(found.score, [row[4] for row in slow], atol=1e-6)
    assert found.label.tolist() == [row[5] for row in slow]
    assert recognise([output], HEIGHT, WIDTH, layout) == head  # told, it is the same


@pytest.mark.parametrize("strides", STRIDES)
def test_other_strides_are_recognised_too(strides):
    output = raw(cells(128, 192, strides))
    head = recognise([output], 128, 192, "")
    assert (head.layout, head.strides) == ("yolox", strides)
    assert len(grid(128, 192, strides)) == output.shape[1]


def test_strides_that_only_the_model_knows():
    output = raw(cells(HEIGHT, WIDTH, (4, 8)))
    with pytest.raises(UnknownHead, match=r"\[1, 960, 8\]"):
        recognise([output], HEIGHT, WIDTH, "")
    assert recognise([output], HEIGHT, WIDTH, "", strides=(4, 8)).strides == (4, 8)
    assert recognise([output], HEIGHT, WIDTH, "yolox", strides=(4, 8)).layout == "yolox"


def test_any_number_of_candidates_where_the_layout_is_told():
    assert recognise([decoded(50)], HEIGHT, WIDTH, "yolov5").classes == 3
    assert recognise([columns(50)], HEIGHT, WIDTH, "yolov8").classes == 3


def test_raw_heads_beside_the_decoded_rows_do_not_matter():
    heads = [np.zeros((1, 3, HEIGHT // s, WIDTH // s, 8), np.float32) for s in (8, 16, 32)]
    output = decoded(3 * cells(HEIGHT, WIDTH))
    assert recognise([*heads, output], HEIGHT, WIDTH, "").output == 3


def test_an_enormous_size_is_still_a_number():
    output = raw()
    output[0, :, 2:4] = 1000
    assert np.isfinite(recognise([output], HEIGHT, WIDTH, "").decode(output, 0.0).xyxy).all()


def with_value(output, where, value):
    changed = output.copy()
    changed[where] = value
    return changed


@pytest.mark.parametrize(
    ("outputs", "layout", "said"),
    [
        ([decoded(77)], "", r"\[1, 77, 8\]; expected \[1, n, 5 \+ classes\] of YOLOX \(n = 252 at 96×128\)"),
        ([decoded(77)], "", "tell which it is with obb.yolo.layout"),
        ([decoded(300, 1)], "", "boxes after suppression are not read: export it without"),
        ([raw()[0]], "", r"outputs are \[252, 8\]"),
        ([np.concatenate([raw(), raw()])], "", r"\[2, 252, 8\]"),
        ([raw(), raw()], "", r"\[1, 252, 8\], \[1, 252, 8\]"),
        ([columns(252), np.zeros((1, 32, 24, 24))], "", r"\[1, 32, 24, 24\]"),  # segmentation
        ([raw()[..., :5]], "", "has 0 classes"),
        ([raw(50)], "yolox", "no cell for each candidate of a raw YOLOX head"),
        ([with_value(raw(), (0, 3, 6), 4.5)], "", "scores reach from .* to 4.5.* export it with its sigmoid"),
        ([with_value(columns(252), (0, 5, 7), -3)], "", "scores reach from -3 to"),
        ([with_value(raw(), (0, 3, 6), np.nan)], "", "not finite"),
        ([raw()], "yolov5", "centres reach to .* pixels of the input were expected"),
        ([decoded(252)], "yolox", "centres reach to .* raw offsets were expected"),
        ([columns(252) / WIDTH], "", "centres reach to"),  # normalised
    ],
)
def test_what_is_not_understood_is_said(outputs, layout, said):
    with pytest.raises(UnknownHead, match=said):
        recognise(outputs, HEIGHT, WIDTH, layout)


def test_another_number_of_names_is_another_head():
    assert recognise([raw()], HEIGHT, WIDTH, "", names=3).classes == 3
    with pytest.raises(UnknownHead, match="has 3 classes, and the model names 4"):
        recognise([raw()], HEIGHT, WIDTH, "", names=4)
