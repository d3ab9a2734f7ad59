"""The models of a run, made once: reading them takes a while, and what is wrong with one is told at the start."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fdslam.compact.shipped import shipped_trees
from fdslam.compact.source import Source
from fdslam.compact.sources import load_source
from fdslam.config import Config
from fdslam.errors import InputError
from fdslam.mask import segmentation
from fdslam.obb import Library, parse_library

if TYPE_CHECKING:
    from fdslam.segmentation import Segmentation


@dataclass(frozen=True)
class Models:
    """The OBB library and the model of the mask."""

    library: Library
    segmentation: Segmentation | None  # None: the mask needs no model
    looks: Source | None  # of dense descriptors; None: no detector needs them

    @property
    def identity(self) -> dict[str, Any]:
        """What decides their results, JSON-able: settings, and digests of weights."""
        return {
            "obb": self.library.identity,
            "mask": self.segmentation and self.segmentation.identity,
            "looks": self.looks and self.looks.identity,
        }


def out_of_their_world(config: Config) -> str:
    """Return the line that says which shipped models a run would use on images they know nothing of; else nothing.

    They were trained on the embedded campus alone.
    """
    if config.dataset.kind == "campus":
        return ""
    sources = parse_library(config.obb.library)
    wanted = {
        "obb.yolo.weights": "YOLO" in sources and not config.obb.yolo.weights,
        "obb.bing.filters": "BING" in sources and not config.obb.bing.filters,
        "compact.weights": bool(config.mix.compact)
        and config.compact.source == "network"
        and not (config.compact.weights or config.obb.yolo.weights or "YOLO" in sources),
        "mask.weights": config.mask.source == "deeplabv3plus" and not config.mask.weights,
    }
    used = [key for key, shipped in wanted.items() if shipped]
    without = {"obb": "obb=j_b", "compact": "compact.source=gradients", "mask": "mask=none"}
    ways = dict.fromkeys(without[key.partition(".")[0]] for key in used)
    files = ", ".join(f"{key}=FILE" for key in used)
    return files and (
        f"{files}: not given, so the shipped ones are used, which know the embedded "
        f"campus alone; real ones are better on real images (docs/models.md), and {', '.join(ways)} does without"
    )


def check_device(device: str) -> None:
    """Raise InputError if torch cannot run there."""
    if not re.fullmatch(r"cpu|cuda(:\d+)?", device):
        raise InputError(f"device={device}: choose cpu or cuda")
    if device != "cpu":
        import torch  # takes seconds, so only where it is asked for

        count = torch.cuda.device_count() if torch.cuda.is_available() else 0
        if int(device.partition(":")[2] or 0) >= count:
            raise InputError(f"device={device}: torch finds {count} CUDA devices here; run with device=cpu")


def load_models(config: Config) -> Models:
    """Return the models that a configuration names.

    Raises:
        InputError: an unknown source of OBBs, a device that is not there, or a model that is missing, damaged or not
            understood.
    """
    check_device(config.device)
    if "EF" in config.mix.detectors and config.early.model == "shipped":
        shipped_trees(config)  # what is wrong with it is told now
    looks = load_source(config) if config.mix.compact else None
    return Models(Library(config.obb, config.device), segmentation(config.mask, config.device), looks)
