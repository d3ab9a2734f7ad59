"""The shipped learner of early fusion: trained on the embedded world, for maps that are too small to train on."""

from __future__ import annotations

from safetensors import SafetensorError, safe_open

from fdslam.compact.features import NAMES
from fdslam.compact.trees import Trees
from fdslam.config import Config
from fdslam.errors import InputError
from fdslam.onnx_model import shipped


def file_name(source: str) -> str:
    """Return the name of the file for a source of dense descriptors."""
    return f"early_fusion_{source}.safetensors"


def shipped_trees(config: Config) -> Trees:
    """Return the shipped learner for the source of descriptors that the configuration names.

    Raises:
        InputError: the file is missing, damaged, or made for other features.
    """
    path = shipped(file_name(config.compact.source))
    way_out = "install the package anew, or train on the map with early.model=map"
    try:
        with safe_open(path, framework="numpy") as file:
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a mapping
            names = (file.metadata() or {}).get("features", "")
    except (OSError, SafetensorError) as error:
        raise InputError(f"{path}: the shipped early fusion cannot be read ({error}); {way_out}") from error
    if names != ",".join(NAMES):
        raise InputError(f"{path}: the shipped early fusion was made for other features; {way_out}")
    return Trees.from_arrays(arrays)
