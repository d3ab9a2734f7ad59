"""How well segmentations tell sky and ground of campuses: ``python -m experiments.train.masks [MODEL.onnx …]``.

Prints, for the shipped model and every one given, the IoU of sky and ground together, as the mask uses them, with the
true labels of every eighth view of the test campuses.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.train.views import HEIGHT, STORE, TEST, WIDTH, Views, load
from fdslam.config import Mask
from fdslam.mask import UNINTERESTING
from fdslam.progress import single_threaded
from fdslam.segmentation import Segmentation

STEP = 8  # every how many of the views


def overlap(model: Segmentation, views: Views) -> tuple[int, int]:
    """Return the pixels of intersection and union of what is sky or ground, and what the model takes for it."""
    both = either = 0
    for image, labels in zip(views.images[::STEP], views.labels[::STEP], strict=True):
        found: NDArray[np.bool_] = np.isin(model.labels(image), UNINTERESTING)
        true = np.isin(labels, UNINTERESTING)
        both, either = both + int((found & true).sum()), either + int((found | true).sum())
    return both, either


def main() -> None:
    """Print one line a model."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("models", nargs="*", help="ONNX files beside the shipped one")
    parser.add_argument("--store", type=Path, default=STORE, help="folder of the rendered views")
    parser.add_argument("--seeds", type=int, nargs="+", default=TEST, help="campuses")
    parser.add_argument("--height", type=int, default=HEIGHT)
    parser.add_argument("--width", type=int, default=WIDTH)
    options = parser.parse_args()
    single_threaded()
    sessions = load(options.store, options.seeds, 2, options.height, options.width, workers=1)
    for name in ("", *options.models):
        model = Segmentation(Mask(source="deeplabv3plus", weights=name), "cpu")
        pixels = {session: overlap(model, views) for session, views in sessions.items()}
        both, either = np.sum(list(pixels.values()), axis=0)
        each = ", ".join(f"{session} {a / b:.3f}" for session, (a, b) in pixels.items())
        print(f"{name or 'shipped'}: {both / either:.3f} ({each})", flush=True)


if __name__ == "__main__":
    main()
