"""Tiny detectors with a backbone of strided convolutions: what its layers hold can be asked for."""

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from tests.onnx_models import colour_finder

CHANNELS = {2: 4, 4: 5, 8: 6, 16: 7, 32: 8}
LAYERS = ("a8", "a16")  # what the backbone computed last at strides 8 and 16


def with_backbone(path, layout="yolox", height=64, width=64, until=32, **options):
    """Write a colour finder that has a backbone too, convolutions of stride 2 down to ``until`` and one beside each."""
    model = onnx.load(colour_finder(path, layout, height, width, **options))
    rng = np.random.default_rng(0)
    graph, before, have = model.graph, "planes" if options.get("planar") is False else "images", 3
    white = 255 if layout == "yolox" else 1
    for stride in (s for s in CHANNELS if s <= until):
        channels = CHANNELS[stride]
        for name, step, taken in ((f"s{stride}", 2, have), (f"t{stride}", 1, channels)):
            weights = rng.standard_normal((channels, taken, 3, 3)) / (3 * np.sqrt(taken))
            weights /= white if before in ("images", "planes") else 1
            graph.initializer.append(numpy_helper.from_array(weights.astype(np.float32), f"w{name}"))
            graph.node.append(
                helper.make_node(
                    "Conv", [before, f"w{name}"], [f"c{name}"], strides=[step, step], pads=[1] * 4, kernel_shape=[3, 3]
                )
            )
            out = f"a{stride}" if step == 1 else f"l{name}"
            graph.node.append(helper.make_node("LeakyRelu", [f"c{name}"], [out], alpha=0.1))
            before = out
        have = channels
    _sorted(graph)
    onnx.checker.check_model(model)
    onnx.save(model, path)
    return path


def _sorted(graph):
    """A node comes after what it needs; a transposed input is made first already."""
    nodes = sorted(graph.node, key=lambda node: node.op_type != "Transpose" or node.input[0] != "images")
    del graph.node[:]
    graph.node.extend(nodes)


def with_outputs(path, names):
    """Return the bytes of a model that puts out these layers."""
    model = onnx.load(path)
    del model.graph.output[:]
    model.graph.output.extend(helper.make_tensor_value_info(name, TensorProto.FLOAT, None) for name in names)
    return model.SerializeToString()
