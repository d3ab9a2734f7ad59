"""Where our paper-mode figures differ from an earlier prototype's, measure why.

    python -m experiments.table1.differences --root ../shared/data/camvid_changes \\
        --yolo ../shared/data/models/yolox_nano.onnx

The prototype's object boxes (BING, YOLO), its keypoints (OpenCV's SIFT) and its k are put into our pipeline one at a
time; everything else stays as it is. ``--yolo`` takes any detector that obb.yolo.weights takes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.config import Ad, Config, Evaluation, Fd, Folder, Obb, Pc, Yolo
from fdslam.context import Context
from fdslam.data.folder import read_folder
from fdslam.data.images import read_image
from fdslam.detectors.comparison import keypoints_to_cells
from fdslam.detectors.fault_diagnosis import loc_cells
from fdslam.detectors.registry import DETECTORS
from fdslam.errors import InputError
from fdslam.localization import localize
from fdslam.mapping import BowMap
from fdslam.metrics import Scene, evaluate
from fdslam.nearest import nearest_distance
from fdslam.obb import Library
from fdslam.progress import single_threaded
from fdslam.proposals import Proposals
from fdslam.store import Store
from fdslam.types import Boxes, Frame


def random_boxes(frame: Frame, count: int = 50) -> NDArray[np.float32]:
    """Return boxes of 24 to 240 pixels anywhere, seeded by the image: what BING's number alone would bring."""
    rng = np.random.default_rng(int(frame.digest[:8], 16))
    size = np.minimum(np.exp(rng.uniform(np.log(24), np.log(240), (count, 2))), [frame.width, frame.height])
    corner = rng.uniform(0, 1, (count, 2)) * ([frame.width, frame.height] - size)
    return np.concatenate([corner, corner + size], axis=1).astype(np.float32)


def with_boxes(context: Context, bow: BowMap, more: Callable[[Frame], NDArray[np.float32]]) -> list:
    """Return FD's cells of every query with further OBBs beside the library's."""
    data, config = context.dataset, context.config
    maps = []
    for frame in data.query:
        extra = more(frame)
        fixed = bow.proposals.of(frame)
        boxes = Boxes(np.concatenate([fixed.xyxy, extra]), fixed.source + ("extra",) * len(extra))
        query, words = bow.features.load(frame), bow.words(frame)
        one = localize(bow.bag, boxes, query, words, config.bow, lambda m: bow.features.load(data.map[m]))
        top = one.ranks[:, one.strong[: config.evaluation.Y]]
        maps.append(loc_cells(one.boxes.xyxy, top, frame.height, frame.width, Fd()))
    return maps


def opencv_sift(context: Context) -> list:
    """Return PC's cells of every query with OpenCV's SIFT keypoints in place of Harris-Laplace."""
    data = context.dataset
    described = {}
    for frame in (*data.map, *data.query):
        points, sifts = cv2.SIFT.create(nfeatures=1500).detectAndCompute(read_image(frame.path), None)
        described[frame] = np.array(cv2.KeyPoint.convert(points)), sifts.astype(np.uint8)
    maps = []
    for frame, top in zip(data.query, context.hypotheses, strict=True):
        xy, sifts = described[frame]
        distance = nearest_distance(sifts, [described[data.map[m]][1] for m in top])
        inside = np.clip(np.floor(xy + 0.5), 0, [frame.width - 1, frame.height - 1]).astype(np.float32)
        maps.append(keypoints_to_cells(inside, distance, frame.height, frame.width, Pc(spread="cell")))
    return maps


def main() -> None:
    """Print one line per variant."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", required=True)
    parser.add_argument("--yolo", type=Path, help="ONNX file of a detector; without it that line is left out")
    parser.add_argument("--store", default="outputs/store")
    options = parser.parse_args()
    single_threaded()
    config, store = Config(store=options.store, obb=Obb("J+B")), Store(options.store)
    data = read_folder(options.root, Folder(kind="folder", root=options.root))
    bow = BowMap(data.map, config.bow, Library(config.obb), store, 0)
    keys, found = bow.localize(data.query)
    hypotheses = tuple(one.strong[: config.evaluation.Y].astype(np.int64) for one in found)
    context = Context(config, data, store, tuple(found), tuple(keys), hypotheses)
    assert data.boxes is not None
    names, heights, widths = zip(*((f.name, f.height, f.width) for f in data.query), strict=True)
    scene = Scene(names, heights, widths, data.boxes)

    def show(name: str, maps: list) -> None:
        row = evaluate(name, maps, scene, Evaluation(), 0)
        accuracy = " / ".join(f"{figure.value:.1f}" for figure in row.pooled.values() if figure)
        lc = row.lc_auroc
        area = f"{lc.value:.3f} ({lc.low:.3f}–{lc.high:.3f})" if lc else "–"
        print(f"| {name} | {accuracy} | {area} |", flush=True)

    print("| variant | X = 5 / 10 / 15 / 20 % | lc-AUROC |\n|---|---|---|")
    show("FD, J+B", list(DETECTORS["FD"].detect(context).loc))
    if options.yolo:
        detector = Library(Obb("YOLO", Yolo(weights=str(options.yolo))))
        found_by = Proposals(detector, store, 0)
        show("FD, J+B and YOLO's boxes", with_boxes(context, bow, lambda frame: found_by.of(frame).xyxy))
    show("FD, J+B and 50 random boxes", with_boxes(context, bow, random_boxes))
    show("PC, Harris-Laplace upscaled to 720", list(DETECTORS["PC"].detect(context).loc))
    coarse = replace(context, config=replace(config, pc=Pc(min_side=0)))
    show("PC, Harris-Laplace at the image's size", list(DETECTORS["PC"].detect(coarse).loc))
    show("PC, OpenCV's SIFT keypoints", opencv_sift(context))
    smooth = replace(context, config=replace(config, pc=Pc(spread="gaussian")))
    show("PC, Harris-Laplace upscaled, blurred", list(DETECTORS["PC"].detect(smooth).loc))
    for k in (4, 10):
        show(f"AD, k = {k}", list(DETECTORS["AD"].detect(replace(context, config=replace(config, ad=Ad(k=k)))).loc))


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        print(f"differences: {error}", file=sys.stderr)
        sys.exit(2)
