"""Which source of dense descriptors a configuration names."""

from __future__ import annotations

from dataclasses import replace

from fdslam.compact.gradients import Gradients
from fdslam.compact.source import Source
from fdslam.config import Config
from fdslam.errors import InputError


def load_source(config: Config) -> Source:
    """Return the source of dense descriptors.

    Raises:
        InputError: a model that is missing, damaged or without features at strides 8 and 16.
    """
    if config.compact.source == "gradients":
        return Gradients(config.compact)
    from fdslam.compact.network import NetworkFeatures  # reading graphs takes a while to import
    from fdslam.obb.yolo import Yolo

    if not config.compact.weights:
        return NetworkFeatures(config.compact, Yolo(config.obb.yolo, config.device), config.compact.threads)
    try:
        detector = Yolo(replace(config.obb.yolo, weights=config.compact.weights, classes=[]), config.device)
    except InputError as error:  # it is a detector like that of the OBBs, and given by another key
        raise InputError(str(error).replace("obb.yolo.weights", "compact.weights")) from error
    return NetworkFeatures(config.compact, detector, config.compact.threads)
