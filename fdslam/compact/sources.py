"""Which source of dense descriptors a configuration names."""

from __future__ import annotations

from dataclasses import replace

from fdslam.compact.gradients import Gradients
from fdslam.compact.source import Source
from fdslam.config import Config


def load_source(config: Config) -> Source:
    """Return the source of dense descriptors.

    Raises:
        InputError: a model that is missing, damaged or without features at strides 8 and 16.
    """
    if config.compact.source == "gradients":
        return Gradients(config.compact)
    from fdslam.compact.network import NetworkFeatures  # reading graphs takes a while to import
    from fdslam.obb.yolo import Yolo

    if config.compact.weights:
        settings = replace(config.obb.yolo, weights=config.compact.weights, classes=[])
        detector = Yolo(settings, config.device, "compact.weights")
    else:
        detector = Yolo(config.obb.yolo, config.device)
    return NetworkFeatures(config.compact, detector, config.compact.threads)
