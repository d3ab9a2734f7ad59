"""From torch to ONNX: batch norms folded in, weights kept in 16 bits, described, and checked against torch."""

from __future__ import annotations

import copy
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import torch
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper
from torch import nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from fdslam.store import write_atomically

OPSET = 18
SMALL = 16  # values: shorter weights stay in 32 bits
TOLERANCE = 1e-3  # largest difference between onnxruntime and torch, relative to the largest value


class Runner:
    """A model as a function from input to output, both float32 arrays.

    Args:
        call: does it.
    """

    def __init__(self, call: Callable[[NDArray[np.float32]], NDArray[np.float32]]) -> None:
        self.call = call

    def __call__(self, x: NDArray[np.float32]) -> NDArray[np.float32]:
        """Run the model."""
        return self.call(x)

    @staticmethod
    def of_network(net: nn.Module, device: str = "cpu") -> Runner:
        """Run a network of torch."""

        @torch.no_grad()
        def call(x: NDArray[np.float32]) -> NDArray[np.float32]:
            y: NDArray[np.float32] = net(torch.from_numpy(x).to(device)).float().cpu().numpy()
            return y

        return Runner(call)

    @staticmethod
    def of_file(path: Path, threads: int = 1) -> Runner:
        """Run an ONNX model."""
        settings = onnxruntime.SessionOptions()
        settings.intra_op_num_threads = settings.inter_op_num_threads = threads
        session = onnxruntime.InferenceSession(path, settings, providers=["CPUExecutionProvider"])
        name = session.get_inputs()[0].name
        return Runner(lambda x: session.run(None, {name: x})[0])


def folded(net: nn.Module) -> nn.Module:
    """Return a copy for inference whose batch norms are part of the convolutions before them."""
    net = copy.deepcopy(net).eval()
    for module in net.modules():
        if isinstance(module, nn.Sequential):
            for k in range(len(module) - 1):
                if isinstance(module[k], nn.Conv2d) and isinstance(module[k + 1], nn.BatchNorm2d):
                    module[k], module[k + 1] = fuse_conv_bn_eval(module[k], module[k + 1]), nn.Identity()
    return net


def halved(model: onnx.ModelProto) -> onnx.ModelProto:
    """Keep the weights in 16 bits, with a cast back to 32 before their use, which onnxruntime folds when it loads."""
    graph = model.graph
    casts = []
    for tensor in list(graph.initializer):
        value = numpy_helper.to_array(tensor)
        if tensor.data_type == TensorProto.FLOAT and value.size >= SMALL:
            short = numpy_helper.from_array(value.astype(np.float16), f"{tensor.name}.half")
            graph.initializer.remove(tensor)
            graph.initializer.append(short)
            casts.append(helper.make_node("Cast", [short.name], [tensor.name], to=TensorProto.FLOAT))
    nodes = [*casts, *graph.node]
    del graph.node[:]
    graph.node.extend(nodes)
    del graph.value_info[:]
    return model


def export(
    net: nn.Module,
    examples: Sequence[NDArray[np.float32]],
    path: Path,
    input_name: str,
    output_name: str,
    metadata: dict[str, str],
) -> float:
    """Write a network as ONNX and compare it with torch.

    Args:
        net: on the CPU.
        examples: inputs of the one shape that the model will take.
        path: file to write.
        input_name: of the model's input.
        output_name: of the model's output.
        metadata: written into the model.

    Returns:
        The largest absolute difference between the outputs of onnxruntime and of torch, both with the weights that
        16 bits can hold.

    Raises:
        ValueError: it is more than TOLERANCE of the largest output, or rounding the weights mattered.
    """
    net = folded(net)
    with torch.no_grad():
        for p in net.parameters():
            p.copy_(p.half().float())
    with tempfile.TemporaryDirectory() as folder:
        raw = Path(folder) / "raw.onnx"
        torch.onnx.export(
            net, (torch.from_numpy(examples[0]),), raw, input_names=[input_name], output_names=[output_name],
            opset_version=OPSET, dynamo=True, external_data=False, verbose=False,
        )  # fmt: skip
        model = halved(onnx.load(raw))
    for node in [*model.graph.node, *model.graph.initializer, *model.graph.input, *model.graph.output]:
        del node.metadata_props[:]  # where in the source each came from: thrice the size of the weights
    for function in list(model.functions):
        model.functions.remove(function)
    model.doc_string, model.graph.name = "", path.stem
    model.producer_name = "fdslam"
    del model.metadata_props[:]
    helper.set_model_props(model, metadata)
    onnx.checker.check_model(model, full_check=True)
    write_atomically(path, model.SerializeToString(deterministic=True))
    ours, theirs = Runner.of_file(path), Runner.of_network(net)
    pairs = [(ours(x), theirs(x)) for x in examples]
    difference = max(float(np.abs(a - b).max()) for a, b in pairs)
    largest = max(float(np.abs(b).max()) for _, b in pairs)
    if not difference <= TOLERANCE * max(1.0, largest):
        raise ValueError(
            f"{path}: onnxruntime differs from torch by {difference:.3g} where the largest value is {largest:.3g}"
        )
    return difference
