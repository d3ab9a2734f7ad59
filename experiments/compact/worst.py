"""Pictures of the changed boxes that EF misses most: python -m experiments.compact.worst [DIR …] --out FOLDER

A sheet per data set, one line per box: the query with its boxes, the best aligned map image, and the heat of CC and EF.
Worst is the box whose mean LoC by EF is above that of the same cells in the fewest unchanged queries.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from experiments.compact.measures import box_mean_matrix
from experiments.compact.prepared import Maps, Prepared, configuration, options, prepared, scene
from fdslam.data.images import read_image
from fdslam.detectors import compact, early
from fdslam.fusion import percentiles
from fdslam.metrics import Scene
from fdslam.progress import single_threaded
from fdslam.store import write_atomically
from fdslam.types import Image

COUNT = 20  # boxes on a sheet
WIDTH, TITLE = 360, 18  # pixels of a panel, and of the line above it
MISSED, OTHER = (255, 60, 60), (255, 255, 255)  # colours of the box that is meant and of its query's others
Missed = tuple[int, int, float]  # query, box of it, share of the unchanged queries that are beaten, 0 to 1


def worst(values: NDArray[np.floating], some: Scene, count: int) -> list[Missed]:
    """Return the boxes that beat the fewest unchanged queries by their mean LoC, the worst first.

    Args:
        values: [N] LoC of the scene's cells.
        some: the queries and their objects.
        count: how many at most; boxes that nothing can be compared with are none.
    """
    a, valid = box_mean_matrix(values, some)
    number, first = valid.sum(axis=1), np.cumsum([0, *(len(boxes) for boxes in some.boxes)])
    share = a.sum(axis=1) / np.maximum(number, 1)
    order = [o for o in np.lexsort((some.objects.listed, share)) if number[o]]
    found = []
    for o in order[:count]:
        q = int(some.by_name[some.objects.query[o]])
        found.append((q, int(some.objects.listed[o] - first[q]), float(share[o])))
    return found


def panel(image: Image, title: str, boxes: Sequence[tuple[NDArray[np.float32], tuple[int, int, int]]] = ()) -> Image:
    """Return an image (uint8 RGB) in the width of a panel, with boxes (xyxy, colour) and a line above it."""
    scale = WIDTH / image.shape[1]
    small = cv2.resize(image, (WIDTH, round(image.shape[0] * scale)), interpolation=cv2.INTER_AREA)
    for box, colour in boxes:
        x0, y0, x1, y1 = np.rint(box * scale).astype(int).tolist()
        cv2.rectangle(small, (x0, y0), (x1, y1), colour, 2)
    line = np.full((TITLE, WIDTH, 3), 255, np.uint8)
    cv2.putText(line, title, (3, TITLE - 5), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (0, 0, 0), 1, cv2.LINE_AA)
    return np.concatenate([line, small]).astype(np.uint8)


def heat(image: Image, places: NDArray[np.floating]) -> Image:
    """Return an image in grey under its cells' places in the pool of all cells, 0 … 1, blue to red from ½ on."""
    level = np.clip(np.rint(510 * (places - 0.5)), 0, 255).astype(np.uint8)
    cells = cv2.applyColorMap(level, cv2.COLORMAP_TURBO)[..., ::-1]
    side = np.repeat(np.repeat(cells, 10, axis=0), 10, axis=1)[: image.shape[0], : image.shape[1]]
    grey = np.repeat(image.mean(axis=2, keepdims=True), 3, axis=2)
    return (0.45 * grey + 0.55 * side).astype(np.uint8)


def sheet(ready: Prepared, missed: Sequence[Missed], maps: dict[str, Maps]) -> Image:
    """Return the lines of all boxes, one below the other, two side by side."""
    data = ready.context.dataset
    places = {name: percentiles(of_all) for name, of_all in maps.items()}
    lines = []
    for query, box, share in missed:
        image, truth = read_image(data.query[query].path), (data.boxes or ())[query]
        colours = [OTHER if i != box else MISSED for i in range(len(truth))]
        marked = list(zip(truth, colours, strict=True))
        other = next(iter(compact.aligned(ready.context, ready.kept, query)), None)
        there = image * 0 if other is None else read_image(data.map[other.image].path)
        agree = "no map image aligns" if other is None else f"{data.map[other.image].name}: {len(other.here)} agree"
        panels = [panel(image, f"{data.query[query].name}: beats {100 * share:.0f} %", marked), panel(there, agree)]
        panels += [panel(heat(image, one[query]), name, marked) for name, one in places.items()]
        height = max(len(one) for one in panels)
        padded = [np.pad(one, ((0, height - len(one)), (0, 4), (0, 0)), constant_values=255) for one in panels]
        lines.append(np.concatenate(padded, axis=1))
    height = max(len(one) for one in lines)
    even = [np.pad(one, ((0, height - len(one)), (0, 0), (0, 0)), constant_values=255) for one in lines]
    even += [np.full_like(even[0], 255)] * (len(even) % 2)
    half = len(even) // 2
    return np.concatenate([np.concatenate(even[:half]), np.concatenate(even[half:])], axis=1)


def main() -> None:
    """Write the sheets."""
    parser = options(__doc__)
    parser.add_argument("--out", type=Path, default=Path("outputs/worst"))
    given = parser.parse_args()
    single_threaded()
    for folder in given.folders or [None]:
        for ready in prepared(configuration(folder, given.yolo, given.bing, given.store)):
            context = ready.context
            maps: dict[str, Maps] = {
                "CC": list(compact.detect(context).loc),
                "EF": list(early.detect(context).loc),
            }
            some = scene(context, range(len(context.dataset.query)))
            missed = worst(some.flatten("EF", maps["EF"]), some, COUNT)
            if not missed:
                continue
            path = given.out / f"{'_'.join((context.dataset.name, *(context.dataset.pair or ())))}.png"
            _, packed = cv2.imencode(".png", sheet(ready, missed, maps)[..., ::-1])
            write_atomically(path, packed.tobytes())
            print(path)


if __name__ == "__main__":
    main()
