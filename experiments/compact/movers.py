"""Do false alarms lie on what moves by itself? python -m experiments.compact.movers DIR … --yolo FILE [--bing FILTERS]

Nobody annotated the real cars and people of a drive. A detector says where there may be some: of the cells of the
unchanged queries that are above the LoC which selects a tenth of all cells, how many lie in its boxes, beside how many
of all cells do; and how many alarms have at least half of their cells there. A box does not tell that a thing has moved
(a parked car stands in the map as well), and of what has driven away nothing is left to detect: the row says how much
of the alarms real movers *can* explain, and no more.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from experiments.compact.controls import AT, untouched
from experiments.compact.measures import LEAST, figure, threshold
from experiments.compact.prepared import Maps, Prepared, configuration, options, prepared, scene
from fdslam.config import Evaluation
from fdslam.data.images import read_image
from fdslam.metrics import Figure, positive_cells
from fdslam.metrics.accuracy import EIGHT
from fdslam.metrics.bootstrap import interval, resample
from fdslam.obb import Library
from fdslam.progress import single_threaded

MOVERS = ("person", "bicycle", "car", "motorcycle", "bus", "truck")  # of COCO
Masks = list[NDArray[np.bool_]]
Counts = list[tuple[int, int]]  # per query how many there are in boxes, and how many there are


def boxed(ready: Prepared, queries: Sequence[int]) -> Masks:
    """Return which cells of some queries at least half lie in a box of something that moves by itself.

    Raises:
        InputError: the detector does not know such classes.
    """
    context = ready.context
    obb = context.config.obb
    only = replace(obb, library="YOLO", yolo=replace(obb.yolo, classes=list(MOVERS)))
    [source] = Library(only).sources.values()
    frames = [context.dataset.query[q] for q in queries]
    return [positive_cells(source.boxes(read_image(frame.path)), frame.height, frame.width) for frame in frames]


def cells_in(maps: Maps, masks: Masks, least_loc: float) -> Counts:
    """Count the cells of every query whose LoC is at least ``least_loc``: those in boxes, and all."""
    above = [cells >= least_loc for cells in maps]
    return [(int((one & mask).sum()), int(one.sum())) for one, mask in zip(above, masks, strict=True)]


def alarms_in(maps: Maps, masks: Masks, least_loc: float) -> Counts:
    """Count the alarms of every query, as ``measures.alarms`` does: those that lie in boxes by half, and all."""
    found = []
    for cells, mask in zip(maps, masks, strict=True):
        labels, count = ndimage.label(cells >= least_loc, structure=EIGHT)
        size = np.bincount(labels.ravel(), minlength=count + 1)[1:]
        inside = np.bincount(labels[mask], minlength=count + 1)[1:]
        large = size >= LEAST
        found.append((int((2 * inside >= size)[large].sum()), int(large.sum())))
    return found


def percent(counts: Counts, config: Evaluation, seed: int) -> Figure | None:
    """Return how many of all are in boxes, %, with its interval over queries; None where there is none at all."""
    inside, every = np.array(counts, np.float64).reshape(-1, 2).T
    if not every.sum():
        return None
    drawn = resample([str(i) for i in range(len(every))], config.bootstrap, seed)
    with np.errstate(invalid="ignore"):  # a draw without any is left out
        return interval(100 * inside.sum() / every.sum(), 100 * (drawn @ inside) / (drawn @ every), config.confidence)


def lines(ready: Prepared) -> Iterator[str]:
    """Yield a row for each method."""
    context, config = ready.context, ready.context.config
    boxes = context.dataset.boxes or ()
    queries = [q for q, one in enumerate(boxes) if not len(one)]
    masks = boxed(ready, queries)
    area = [(int(mask.sum()), mask.size) for mask in masks]
    settings, seed = config.evaluation, config.seed
    for method, maps in untouched(ready).items():
        least = threshold(scene(context, range(len(maps))).flatten(method, maps), AT)
        some = [maps[q] for q in queries]
        counts = area, cells_in(some, masks, least), alarms_in(some, masks, least)
        shown = " | ".join(figure(percent(one, settings, seed), 1) for one in counts)
        number = sum(every for _, every in counts[2])
        yield f"| {context.dataset.name} | {method} | {len(queries)} | {number} | {shown} |"


def main() -> None:
    """Print the table."""
    given = options(__doc__).parse_args()
    single_threaded()
    print("| data set | rows | unchanged queries | alarms | % of all cells in boxes | of those above | of the alarms |")
    print("|---|---|---:|---:|---|---|---|", flush=True)
    for folder in given.folders:
        for ready in prepared(configuration(folder, given.yolo, given.bing, given.store)):
            for line in lines(ready):
                print(line, flush=True)


if __name__ == "__main__":
    main()
