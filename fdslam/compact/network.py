"""Dense descriptors from the inside of an ONNX detector: what its backbone knows before it leaves stride 8 and 16.

The layers are found by their stride: the input of the first convolution that goes on to the next stride is the last
that the backbone computed at its own. YOLOX, YOLOv5 and later, and other detectors built of strided convolutions have
them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx.utils import Extractor

from fdslam.compact.canvas import STRIDES, Canvas, canvas_of
from fdslam.compact.gradients import grids_of
from fdslam.compact.grid import Grid
from fdslam.compact.source import Level
from fdslam.config import Dense
from fdslam.errors import InputError
from fdslam.obb.yolo import Yolo
from fdslam.onnx_model import make_session
from fdslam.types import Image


class NetworkFeatures:
    """The backbone of a detector as a source."""

    def __init__(self, config: Dense, detector: Yolo, threads: int) -> None:
        """Cut the layers out of the model.

        Args:
            config: how large images are seen.
            detector: whose model it is, and how it wants its input.
            threads: of one inference.

        Raises:
            InputError: a model without features at strides 8 and 16.
        """
        self.config, self.detector = config, detector
        model = detector.model
        data, self.layers = truncated(model.path.read_bytes(), detector.height, detector.width, model.where)
        self.session = make_session(model.where, data, threads, model.provider)

    @property
    def identity(self) -> dict[str, Any]:
        """What decides the descriptors of an image."""
        channels, white, _ = self.detector.input
        size = [self.detector.height, self.detector.width]
        return {
            "source": "network",
            **self.detector.model.identity,
            "input": [channels, white, *size],
            "layers": list(self.layers),
            "pixels": [self.config.kilobytes, self.config.fine_bits, self.config.coarse_bits],
        }

    def _canvas(self, height: int, width: int) -> Canvas:
        return canvas_of(height, width, self.detector.height, self.detector.width, self.config)

    def grids(self, height: int, width: int) -> tuple[Grid, Grid]:
        """Return where the descriptors of an image of that size lie."""
        return grids_of(self._canvas(height, width), height, width)

    def describe(self, image: Image) -> tuple[Level, Level]:
        """Return the fine and the coarse descriptors of an image."""
        canvas = self._canvas(*image.shape[:2])
        channels, white, _ = self.detector.input
        drawn = canvas.draw(image)
        fed = (drawn[..., ::-1] if channels == "bgr" else drawn).astype(np.float32) * np.float32(white / 255)
        seen = [
            (top, left, self._run(fed[top : top + canvas.tile_height, left : left + canvas.tile_width]))
            for top in canvas.tops
            for left in canvas.lefts
        ]
        fine, coarse = (
            _stitched([(top, left, maps[i]) for top, left, maps in seen], canvas, stride)
            for i, stride in enumerate(STRIDES)
        )
        return fine, coarse

    def _run(self, tile: NDArray[np.float32]) -> list[Level]:
        model = self.detector.model
        found = model.run_part(self.session, tile)
        if not all(np.isfinite(one).all() for one in found):
            raise InputError(f"{model.where}: its features are not finite; the model is damaged")
        return [one[0].transpose(1, 2, 0).astype(np.float32) for one in found]


def _stitched(seen: list[tuple[int, int, Level]], canvas: Canvas, stride: int) -> Level:
    """Return one grid of what the tiles (top, left, features) saw, each cell from the tile it is deepest in."""
    if len(seen) == 1:
        rows, cols = canvas.grid_shape(stride)
        return np.ascontiguousarray(seen[0][2][:rows, :cols])
    height, width = canvas.tops[-1] + canvas.tile_height, canvas.lefts[-1] + canvas.tile_width
    result = np.zeros((height // stride, width // stride, seen[0][2].shape[2]), np.float32)
    depth = np.full(result.shape[:2], -1.0)
    for top, left, features in seen:
        rows, cols = features.shape[:2]
        own = np.minimum.outer(*(np.minimum(np.arange(n), np.arange(n)[::-1]) for n in (rows, cols)))
        part = np.s_[top // stride : top // stride + rows, left // stride : left // stride + cols]
        better = own > depth[part]
        result[part][better] = features[better]
        depth[part][better] = own[better]
    rows, cols = canvas.grid_shape(stride)
    return np.ascontiguousarray(result[:rows, :cols])


def truncated(data: bytes, height: int, width: int, where: str) -> tuple[bytes, tuple[str, ...]]:
    """Return the part of a model that computes the features, and the names of their layers, fine and coarse.

    Args:
        data: an ONNX model with one image as input.
        height: of its input, pixels.
        width: likewise.
        where: names the model in messages.

    Raises:
        InputError: it has no convolution that leaves stride 8, or 16.
    """
    model = onnx.load_from_string(data)
    [image] = [one for one in model.graph.input if one.name not in {w.name for w in model.graph.initializer}]
    planar = image.type.tensor_type.shape.dim[1].dim_value == 3
    for axis, side in zip((2, 3) if planar else (1, 2), (height, width), strict=True):
        image.type.tensor_type.shape.dim[axis].dim_value = side
    image.type.tensor_type.shape.dim[0].dim_value = 1
    model = onnx.shape_inference.infer_shapes(model)
    shapes = {
        value.name: [one.dim_value for one in value.type.tensor_type.shape.dim]
        for value in (*model.graph.value_info, *model.graph.input, *model.graph.output)
    }
    layers = []
    for stride in STRIDES:
        before, after = ([height // s, width // s] for s in (stride, 2 * stride))
        leaving = (
            node.input[0]
            for node in model.graph.node
            if node.op_type == "Conv"
            and shapes.get(node.input[0], [])[2:] == before
            and shapes.get(node.output[0], [])[2:] == after
        )
        layer = next(leaving, None)
        if layer is None:
            raise InputError(
                f"{where}: no convolution of it goes from stride {stride} to {2 * stride}, so its features are not "
                "found; give another detector with compact.weights=FILE, or run with compact.source=gradients"
            )
        layers.append(layer)
    part = Extractor(model).extract_model([image.name], layers)
    return part.SerializeToString(), tuple(layers)
