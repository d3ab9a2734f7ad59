"""Tiny ONNX models with outputs that are known: what they find is what was painted."""

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

STRIDES = (8, 16, 32)
COLOURS = ("red", "green", "blue")


def cells(height, width, strides=STRIDES):
    return sum((height // s) * (width // s) for s in strides)


def model(nodes, inputs, outputs, constants=(), metadata=None):
    """Return a model: inputs and outputs are (name, shape), constants (name, array)."""
    graph = helper.make_graph(
        nodes,
        "tiny",
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in inputs],
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in outputs],
        [numpy_helper.from_array(np.asarray(array), name) for name, array in constants],
    )
    made = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=10)
    helper.set_model_props(made, metadata or {})
    onnx.checker.check_model(made)
    return made


def constant(path, *arrays, shape=(1, 3, 64, 64), metadata=None):
    """Write a model that puts out the arrays, whatever it sees."""
    nodes = [helper.make_node("Identity", [f"c{i}"], [f"y{i}"]) for i in range(len(arrays))]
    outputs = [(f"y{i}", array.shape) for i, array in enumerate(arrays)]
    constants = [(f"c{i}", array.astype(np.float32)) for i, array in enumerate(arrays)]
    onnx.save(model(nodes, [("images", shape)], outputs, constants, metadata), path)
    return path


def boxes_of_cells(height, width, layout, size):
    """Return [n, 4] of what a head puts out for boxes of ``size`` cells around every cell."""
    rows = []
    for stride in STRIDES:
        for y in range(height // stride):
            for x in range(width // stride):
                raw = [0.5, 0.5, np.log(size), np.log(size)]
                decoded = [(x + 0.5) * stride, (y + 0.5) * stride, size * stride, size * stride]
                rows.append(raw if layout == "yolox" else decoded)
    return np.array(rows, np.float32)


def colour_finder(path, layout, height=64, width=64, white=None, dynamic=False, planar=True, metadata=None, size=1.0):
    """Write a detector of three classes, the channels of its input: a cell's score is how full the channel is there.

    It puts a box of ``size`` cells around every cell of strides 8, 16 and 32.
    """
    white = white or (255.0 if layout == "yolox" else 1.0)
    nodes, parts = [], []
    planes = "images"
    if not planar:
        nodes.append(helper.make_node("Transpose", ["images"], ["planes"], perm=[0, 3, 1, 2]))
        planes = "planes"
    for s in STRIDES:
        nodes.append(helper.make_node("AveragePool", [planes], [f"p{s}"], kernel_shape=[s, s], strides=[s, s]))
        nodes.append(helper.make_node("Reshape", [f"p{s}", "flat"], [f"f{s}"]))
        parts.append(f"f{s}")
    nodes.append(helper.make_node("Concat", parts, ["sums"], axis=2))
    nodes.append(helper.make_node("Mul", ["sums", "scale"], ["columns"]))
    constants = [("flat", np.array([1, 3, -1])), ("scale", np.float32(1 / white))]
    boxes = boxes_of_cells(height, width, layout, size)
    n = len(boxes)
    if layout == "yolov8":
        constants.append(("boxes", boxes.T[None]))
        nodes.append(helper.make_node("Concat", ["boxes", "columns"], ["output"], axis=1))
        shape = [1, 7, n]
    else:
        anchors = 3 if layout == "yolov5" else 1
        sure = np.ones((1, n, 1), np.float32)
        constants.append(("boxes", np.concatenate([np.concatenate([boxes[None], sure], axis=2)] * anchors, axis=1)))
        nodes.append(helper.make_node("Transpose", ["columns"], ["rows"], perm=[0, 2, 1]))
        nodes.append(helper.make_node("Concat", ["rows"] * anchors, ["scores"], axis=1))
        nodes.append(helper.make_node("Concat", ["boxes", "scores"], ["output"], axis=2))
        shape = [1, anchors * n, 8]
    sizes = ["height", "width"] if dynamic else [height, width]
    inputs = [("images", [1, 3, *sizes] if planar else [1, *sizes, 3])]
    outputs = [("output", ["one", "rows", "columns"] if dynamic else shape)]
    onnx.save(model(nodes, inputs, outputs, constants, metadata), path)
    return path


def painter(path, classes, height=64, width=64, kind="planar", factor=1, metadata=None, free=False):
    """Write a segmentation that tells how bright red is: class k where v / 255 is near k / (classes - 1).

    Its input is v / 255 in RGB; ``kind`` is planar or last (logits), numbers (of classes), or numbers4 (1 between).
    """
    levels = np.linspace(0, 1, classes, dtype=np.float32).reshape(1, classes, 1, 1)
    nodes = [
        helper.make_node("AveragePool", ["image"], ["small"], kernel_shape=[factor] * 2, strides=[factor] * 2),
        helper.make_node("Slice", ["small", "zero", "one", "axis"], ["red"]),
        helper.make_node("Sub", ["red", "levels"], ["distance"]),
        helper.make_node("Abs", ["distance"], ["far"]),
        helper.make_node("Neg", ["far"], ["logits"]),
    ]
    constants = [("levels", levels), ("zero", np.array([0])), ("one", np.array([1])), ("axis", np.array([1]))]
    sizes = ["h", "w"] if free else [height, width]
    out = ["a", "b"] if free else [height // factor, width // factor]
    shape, dtype = [1, classes, *out], TensorProto.FLOAT
    if kind == "last":
        nodes.append(helper.make_node("Transpose", ["logits"], ["y"], perm=[0, 2, 3, 1]))
        shape = [1, *out, classes]
    elif kind == "planar":
        nodes.append(helper.make_node("Identity", ["logits"], ["y"]))
    else:
        nodes.append(helper.make_node("ArgMax", ["logits"], ["y"], axis=1, keepdims=int(kind == "numbers4")))
        shape, dtype = ([1, 1, *out] if kind == "numbers4" else [1, *out]), TensorProto.INT64
    graph = helper.make_graph(
        nodes,
        "painter",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, *sizes])],
        [helper.make_tensor_value_info("y", dtype, shape)],
        [numpy_helper.from_array(array, name) for name, array in constants],
    )
    made = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=10)
    helper.set_model_props(made, metadata or {})
    onnx.checker.check_model(made)
    onnx.save(made, path)
    return path
