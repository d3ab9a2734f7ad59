"""Where our paper-mode figures differ from an earlier prototype's, measure why.

    python -m experiments.table1.differences --root ../shared/data/camvid_changes \\
        --yolo ../shared/data/models/yolox_nano.onnx

The prototype's object boxes (BING, YOLO), its keypoints (OpenCV's SIFT) and its k are put into our pipeline one at a
time; everything else stays as it is. ``--yolo`` takes a YOLOX model with raw heads and 416 × 416 pixels of input.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import onnxruntime
from numpy.typing import NDArray

from fdslam.config import Ad, Config, Evaluation, Fd, Folder, Pc
from fdslam.context import Context
from fdslam.data.folder import read_folder
from fdslam.data.images import read_image
from fdslam.detectors import DETECTORS
from fdslam.detectors.comparison import keypoints_to_cells, nearest_distance
from fdslam.detectors.fault_diagnosis import loc_cells
from fdslam.errors import InputError
from fdslam.localization import localize
from fdslam.mapping import BowMap
from fdslam.metrics import Scene, evaluate
from fdslam.obb import library_boxes
from fdslam.progress import single_threaded
from fdslam.store import Store
from fdslam.types import Boxes, Frame, Image

SIDE, MOST, SCORE, OVERLAP = 416, 11, 0.25, 0.45


def yolox(session: onnxruntime.InferenceSession, image: Image) -> NDArray[np.float32]:
    """Return at most MOST boxes of a YOLOX network with raw heads: float32 [n, 4] xyxy pixels."""
    height, width = image.shape[:2]
    ratio = min(SIDE / height, SIDE / width)
    canvas = np.full((SIDE, SIDE, 3), 114, np.uint8)
    small = cv2.resize(image, (round(width * ratio), round(height * ratio)))
    canvas[: small.shape[0], : small.shape[1]] = small
    raw = session.run(None, {"images": canvas[..., ::-1].transpose(2, 0, 1)[None].astype(np.float32)})[0][0]
    grids = [np.mgrid[: SIDE // s, : SIDE // s][::-1].reshape(2, -1).T for s in (8, 16, 32)]
    stride = np.concatenate([np.full((len(g), 1), s) for g, s in zip(grids, (8, 16, 32), strict=True)])
    centre, size = (raw[:, :2] + np.concatenate(grids)) * stride / ratio, np.exp(raw[:, 2:4]) * stride / ratio
    score = (raw[:, 4:5] * raw[:, 5:]).max(axis=1)
    corner = np.concatenate([centre - size / 2, size], axis=1)
    kept = np.array(cv2.dnn.NMSBoxes(corner.tolist(), score.tolist(), SCORE, OVERLAP), int).ravel()[:MOST]
    boxes = np.concatenate([corner[kept, :2], corner[kept, :2] + corner[kept, 2:]], axis=1)
    return np.clip(boxes, 0, [width, height, width, height]).astype(np.float32)


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
        image, extra = read_image(frame.path), more(frame)
        fixed = library_boxes(config.obb.library, image)
        boxes = Boxes(np.concatenate([fixed.xyxy, extra]), fixed.source + ("extra",) * len(extra))
        one = localize(bow.index, boxes, bow.features.load(frame).xy, bow.words(frame), config.bow)
        top = one.ranks[:, one.strong[: config.evaluation.Y]]
        maps.append(loc_cells(one.boxes.xyxy, top, frame.height, frame.width, Fd()))
    return maps


def opencv_sift(context: Context) -> list:
    """Return PC's cells of every query with OpenCV's SIFT keypoints in place of Harris-Laplace."""
    data = context.dataset
    described = {}
    for frame in (*data.map, *data.query):
        points, sifts = cv2.SIFT.create(nfeatures=1500).detectAndCompute(read_image(frame.path), None)
        described[frame] = np.array(cv2.KeyPoint.convert(points)), sifts
    maps = []
    for frame, top in zip(data.query, context.hypotheses, strict=True):
        xy, sifts = described[frame]
        distance = nearest_distance(sifts, [described[data.map[m]][1] for m in top])
        inside = np.clip(np.floor(xy + 0.5), 0, [frame.width - 1, frame.height - 1]).astype(np.float32)
        maps.append(keypoints_to_cells(inside, distance, frame.height, frame.width, "cell", 1.5))
    return maps


def main() -> None:
    """Print one line per variant."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", required=True)
    parser.add_argument("--yolo", type=Path, help="YOLOX model with raw heads; without it that line is left out")
    parser.add_argument("--store", default="outputs/store")
    options = parser.parse_args()
    single_threaded()
    config, store = Config(store=options.store), Store(options.store)
    data = read_folder(options.root, Folder(kind="folder", root=options.root))
    bow = BowMap(data.map, config.bow, config.obb.library, store, 0)
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
    show("FD, J+B", list(DETECTORS["FD"](context).loc))
    if options.yolo:
        session = onnxruntime.InferenceSession(str(options.yolo))
        show("FD, J+B and YOLO's boxes", with_boxes(context, bow, lambda frame: yolox(session, read_image(frame.path))))
    show("FD, J+B and 50 random boxes", with_boxes(context, bow, random_boxes))
    show("PC, Harris-Laplace upscaled to 720", list(DETECTORS["PC"](context).loc))
    coarse = replace(context, config=replace(config, pc=Pc(min_side=0)))
    show("PC, Harris-Laplace at the image's size", list(DETECTORS["PC"](coarse).loc))
    show("PC, OpenCV's SIFT keypoints", opencv_sift(context))
    smooth = replace(context, config=replace(config, pc=Pc(spread="gaussian")))
    show("PC, Harris-Laplace upscaled, blurred", list(DETECTORS["PC"](smooth).loc))
    for k in (4, 10):
        show(f"AD, k = {k}", list(DETECTORS["AD"](replace(context, config=replace(config, ad=Ad(k=k)))).loc))


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        print(f"differences: {error}", file=sys.stderr)
        sys.exit(2)
