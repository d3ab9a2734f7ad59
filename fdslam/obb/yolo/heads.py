"""What a YOLO-style model puts out, and how it becomes boxes.

| layout | output, for n candidates and c classes | coordinates |
|---|---|---|
| yolox  | [1, n, 5 + c], n = one a cell of the strides' grids | raw: offset to the cell and log size, both in strides |
| yolov5 | [1, n, 5 + c], any n; as exported, three or one a cell | decoded: centre and size, pixels of the input |
| yolov8 | [1, 4 + c, n], no objectness | decoded |

Sources: the export scripts' documented outputs of YOLOX, YOLOv5 and YOLOv7, YOLOv8 and YOLO11.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LAYOUTS = ("yolox", "yolov5", "yolov8")
STRIDES = ((8, 16, 32), (8, 16, 32, 64), (16, 32), (8, 16), (4, 8, 16, 32))  # whose grids are looked for
_ANCHORS = (1, 3)  # candidates a cell
_TOLERANCE = 1e-3  # of scores: half-precision models leave 0 … 1 by that much
_LARGEST_LOG = 50.0  # of a raw size: beyond every image, and its exponential is still a number
_REACH = 4  # decoded centres span more than the 4th part of the input, raw offsets never


class UnknownHead(ValueError):
    """An output that is not understood; the message says what was found and what was expected."""


@dataclass(frozen=True)
class Candidates:
    """Boxes before non-maximum suppression."""

    xyxy: NDArray[np.float64]  # [k, 4] pixels of the input
    score: NDArray[np.float32]  # [k] of the best class
    label: NDArray[np.int64]  # [k] that class


@dataclass(frozen=True)
class Head:
    """How the output of one model is read."""

    layout: str  # yolox, yolov5 or yolov8
    output: int  # which of the model's outputs
    classes: int
    strides: tuple[int, ...]  # of yolox; others need none
    height: int  # of the input, pixels
    width: int

    def decode(self, output: NDArray, least: float) -> Candidates:
        """Return the candidates of at least that score from the output for one image."""
        rows = output[0].T if self.layout == "yolov8" else output[0]
        rows = rows.astype(np.float32, copy=False)
        of_class = rows[:, 4:] if self.layout == "yolov8" else rows[:, 4:5] * rows[:, 5:]
        label = of_class.argmax(axis=1)
        score = of_class[np.arange(len(rows)), label]
        kept = np.flatnonzero(score >= least)
        box = rows[kept, :4].astype(np.float64)
        if self.layout == "yolox":
            cell = grid(self.height, self.width, self.strides)[kept]
            box[:, :2] = (box[:, :2] + cell[:, :2]) * cell[:, 2:]
            box[:, 2:] = np.exp(np.minimum(box[:, 2:], _LARGEST_LOG)) * cell[:, 2:]
        half = box[:, 2:] / 2
        return Candidates(np.concatenate([box[:, :2] - half, box[:, :2] + half], axis=1), score[kept], label[kept])


def grid(height: int, width: int, strides: Sequence[int]) -> NDArray[np.float64]:
    """Return column, row and stride of every cell, finest stride first, row by row: [n, 3]."""
    parts = []
    for stride in strides:
        y, x = np.mgrid[: height // stride, : width // stride]
        parts.append(np.stack([x.ravel(), y.ravel(), np.full(x.size, stride)], axis=1))
    return np.concatenate(parts).astype(np.float64)


def _cells(height: int, width: int, strides: Sequence[int]) -> int:
    return sum((height // s) * (width // s) for s in strides)


def _grids(count: int, height: int, width: int) -> tuple[int, tuple[int, ...]] | None:
    """Return how many candidates a cell and which strides give ``count`` candidates."""
    found = ((a, s) for a in _ANCHORS for s in STRIDES if a * _cells(height, width, s) == count)
    return next(found, None)


def recognise(
    outputs: Sequence[NDArray], height: int, width: int, layout: str, strides: Sequence[int] = (), names: int = 0
) -> Head:
    """Tell from what a model put out for a grey canvas how its output is read.

    Args:
        outputs: all of the model's outputs.
        height: of the input, pixels.
        width: of the input, pixels.
        layout: what the configuration or the model says; empty: neither does.
        strides: of raw heads, where the model says; none: those of ``STRIDES`` that fit.
        names: number of classes that the model names; 0: none.

    Raises:
        UnknownHead: it is none of the layouts, or not the one told.
    """
    shapes = ", ".join(str(list(output.shape)) for output in outputs)
    three = _cells(height, width, STRIDES[0])
    expected = (
        f"expected [1, n, 5 + classes] of YOLOX (n = {three} at {height}×{width}) or of YOLOv5 and v7 "
        f"(n = {3 * three}), or [1, 4 + classes, n] of YOLOv8 and 11 (n = {three})"
    )
    flat = [i for i, output in enumerate(outputs) if output.ndim == 3 and output.shape[0] == 1]
    others = [output.ndim for i, output in enumerate(outputs) if i not in flat]
    if len(flat) != 1 or any(ndim != 5 for ndim in others):  # YOLOv5 may put its raw heads, of 5 axes, beside
        raise UnknownHead(f"its outputs are {shapes}; {expected}")
    output = outputs[flat[0]]
    if not np.isfinite(output).all():
        raise UnknownHead("its output for a grey image is not finite; the file is damaged or needs another input")
    layout = layout or _layout(output, height, width, strides)
    if not layout:
        after = "; boxes after suppression are not read: export it without" if output.shape[2] in (6, 7) else ""
        raise UnknownHead(f"its outputs are {shapes}{after}; {expected}; or tell which it is with obb.yolo.layout")
    classes = output.shape[1] - 4 if layout == "yolov8" else output.shape[2] - 5
    if classes < 1 or (names and names != classes):
        named = f", and the model names {names}" if names else ""
        raise UnknownHead(f"its output {shapes} read as {layout} has {classes} classes{named}; {expected}")
    if layout == "yolox":
        found = tuple(strides) if strides else (_grids(output.shape[1], height, width) or (0, ()))[1]
        if not found or _cells(height, width, found) != output.shape[1]:
            raise UnknownHead(f"its output {shapes} has no cell for each candidate of a raw YOLOX head; {expected}")
    else:
        found = ()
    head = Head(layout, flat[0], classes, found, height, width)
    _check_values(head, output)
    return head


def _layout(output: NDArray, height: int, width: int, strides: Sequence[int]) -> str:
    """Return the layout that the shape tells, or "" where none fits."""
    if strides and output.shape[1] == _cells(height, width, strides):
        return "yolov5" if _spans(output[0, :, :2], height, width) else "yolox"
    if rows := _grids(output.shape[1], height, width):
        return "yolox" if rows[0] == 1 and not _spans(output[0, :, :2], height, width) else "yolov5"
    return "yolov8" if _grids(output.shape[2], height, width) else ""


def _spans(xy: NDArray, height: int, width: int) -> bool:
    return bool(np.abs(xy).max() * _REACH > min(height, width))


def _check_values(head: Head, output: NDArray) -> None:
    rows = output[0].T if head.layout == "yolov8" else output[0]
    scores = rows[:, 4:]
    if scores.min() < -_TOLERANCE or scores.max() > 1 + _TOLERANCE:
        raise UnknownHead(
            f"read as {head.layout}, its scores reach from {scores.min():.3g} to {scores.max():.3g}; between 0 and 1 "
            "was expected: export it with its sigmoid"
        )
    spans = _spans(rows[:, :2], head.height, head.width)
    if spans == (head.layout == "yolox"):
        kind = "raw offsets" if head.layout == "yolox" else "pixels of the input"
        raise UnknownHead(
            f"read as {head.layout}, its centres reach to {np.abs(rows[:, :2]).max():.4g}; {kind} were expected"
        )
