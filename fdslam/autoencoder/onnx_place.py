"""The AE of a place as an ONNX model: written with the extra ``export``, run by onnxruntime (§AD)."""

from __future__ import annotations

import importlib.util
import io
import warnings
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from fdslam.autoencoder.network import network_with
from fdslam.autoencoder.places import PlaceModel
from fdslam.autoencoder.scoring import error_map, error_to_cells, z_score
from fdslam.errors import InputError
from fdslam.onnx_model import Model, load_model
from fdslam.store import write_atomically
from fdslam.types import Cells, Image

OPSET = 18
KIND = "autoencoder"  # what the metadata call such a model


def check_export() -> None:
    """Raise InputError where what ``export_place`` needs is not installed."""
    for name in ("onnx", "onnxscript"):
        if importlib.util.find_spec(name) is None:
            raise InputError(f"ONNX export needs {name}, which is not installed: pip install 'fdslam[export]'")


def export_place(model: PlaceModel, size: tuple[int, int], path: Path) -> None:
    """Write the AE of a place as ONNX: float32 [1, 3, h, w] in 0..1 to its reconstruction.

    The metadata hold what makes its RE comparable: ``fdslam.l1`` (likewise ssim, gradient) is "μ σ".

    Args:
        model: the AE, its statistics filled in.
        size: (h, w) of its input.
        path: file to write, through a temporary one.

    Raises:
        InputError: onnx or onnxscript is not installed, or the file cannot be written.
    """
    check_export()
    import onnx

    network = network_with(model.weights, size).eval()
    with warnings.catch_warnings(), redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")  # of the exporter's own doing
        program = torch.onnx.export(
            network, (torch.zeros(1, 3, *size),), None, input_names=["image"], output_names=["reconstruction"],
            opset_version=OPSET, dynamo=True, external_data=False, verbose=False,
        )  # fmt: skip
    assert program is not None
    proto = program.model_proto
    for node in [*proto.graph.node, *proto.graph.initializer, *proto.graph.input, *proto.graph.output]:
        del node.metadata_props[:]  # where in the source each came from
    proto.producer_name, proto.doc_string = "fdslam", ""
    numbers = {f"fdslam.{kind}": f"{mu!r} {sigma!r}" for kind, (mu, sigma) in model.held_out.items()}
    onnx.helper.set_model_props(proto, {"fdslam.kind": KIND, **numbers})
    onnx.checker.check_model(proto, full_check=True)
    write_atomically(path, proto.SerializeToString(deterministic=True))


@dataclass(frozen=True)
class OnnxPlace:
    """The AE of a place, run by onnxruntime."""

    model: Model

    @staticmethod
    def load(path: str | Path, device: str = "cpu") -> OnnxPlace:
        """Read what ``export_place`` has written.

        Raises:
            InputError: no such file, or another model.
        """
        model = load_model(path, "autoencoder", "python -m fdslam.export_autoencoders writes them", device=device)
        if model.metadata.get("fdslam.kind") != KIND or model.height is None or model.width is None:
            raise InputError(f"autoencoder={path}: not the autoencoder of a place; export the map's anew")
        return OnnxPlace(model)

    def z(self, image: Image, kind: str = "l1") -> NDArray[np.float32]:
        """Return (RE − μ) / σ at the AE's pixels, float32 [h, w], of an image uint8 RGB [H, W, 3] of any size.

        Raises:
            InputError: the model holds no statistics of that kind of error.
        """
        moments = self.model.numbers(kind)
        if len(moments) != 2:
            raise InputError(f"{self.model.where}: no μ and σ of the error {kind}; export the map's autoencoders anew")
        assert self.model.height is not None
        assert self.model.width is not None
        size = self.model.width, self.model.height
        shown = cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.float32) / np.float32(255)
        [output] = self.model.run(shown)
        planar = torch.from_numpy(np.ascontiguousarray(shown.transpose(2, 0, 1)[None]))
        return z_score(error_map(kind, planar, torch.from_numpy(output))[0], *moments)

    def cells(self, image: Image, kind: str = "l1") -> Cells:
        """Return the largest z of every cell of an image, as ``ad.region=pixel`` scores it before dividing by c."""
        return error_to_cells(self.z(image, kind), *image.shape[:2])
