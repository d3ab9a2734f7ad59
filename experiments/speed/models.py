"""What a look by a model costs an image, one thread, each with and without what is done around the network itself.

    python -m experiments.speed.models --yolo ../shared/data/models/yolox_nano.onnx \\
        --mask ../shared/data/models/deeplabv3plus_mnv2_ade20k32_512.onnx ../shared/data/camvid_changes/query

CPU seconds. The network alone is the baseline; U is as in ``experiments.speed.stages``.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np

from experiments.speed.stages import cpu_seconds, random_descriptors, unit_seconds
from fdslam.config import Mask
from fdslam.config import Yolo as Settings
from fdslam.data.images import read_image
from fdslam.obb.yolo import Yolo
from fdslam.onnx_model import Model
from fdslam.progress import single_threaded
from fdslam.segmentation import Segmentation
from fdslam.types import Image

IMAGES = 5


def row(name: str, look: Callable[[Image], object], model: Model, side: tuple[int, int], images: list[Image]) -> str:
    """Return a line of the table: what a look costs, and the network alone."""
    unit = unit_seconds(random_descriptors())
    grey = np.full((*side, 3), 0.5, np.float32)
    network = cpu_seconds(lambda: model.run(grey))
    whole = sum(cpu_seconds(lambda i=image: look(i)) for image in images) / len(images)  # type: ignore[misc]
    return f"| {name} | {1e3 * whole:.1f} | {1e3 * network:.1f} | {whole / network:.2f} | {whole / unit:.1f} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="of images; every n-th of them is looked at")
    parser.add_argument("--yolo", help="ONNX file of a detector")
    parser.add_argument("--mask", help="ONNX file of a segmentation")
    options = parser.parse_args()
    single_threaded()
    paths = sorted(options.folder.glob("*.jpg"))
    images = [read_image(path) for path in paths[:: max(1, len(paths) // IMAGES)][:IMAGES]]
    print("| look | ms an image | network alone, ms | ratio | U |\n|---|---:|---:|---:|---:|")
    if options.yolo:
        yolo = Yolo(Settings(weights=options.yolo))
        print(row("YOLO", yolo.detect, yolo.model, (yolo.height, yolo.width), images))
    if options.mask:
        model = Segmentation(Mask("deeplabv3plus", weights=options.mask))
        print(row("mask", model.labels, model.model, (model.height, model.width), images))


if __name__ == "__main__":
    main()
