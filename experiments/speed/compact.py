"""One query in mode best, stage by stage: python -m experiments.speed.compact [DIR …] [--yolo FILE] [--bing FILTERS]

Every stage of the pipeline for queries of every folder or, without one, of the campus, by the functions that the
pipeline calls, in one thread and without the store. The map, its looks and its learner are made first. U is the time of
OpenCV's brute-force 2-NN of 1,490 × 1,490 descriptors in the same process.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from experiments.compact.prepared import Prepared, configuration, options, prepared
from experiments.speed.query import Watch
from experiments.speed.stages import random_descriptors, unit_seconds
from fdslam.bow.around import candidates
from fdslam.bow.orb import extract
from fdslam.compact.alignment import align
from fdslam.compact.evidence import evidence
from fdslam.compact.features import features
from fdslam.compact.training import fd_of
from fdslam.compact.trees import Trees
from fdslam.config import Config
from fdslam.data.images import read_image
from fdslam.detectors.early import trees_of
from fdslam.detectors.fault_diagnosis import loc_cells, unsupported, with_support
from fdslam.detectors.support import HYPOTHESES, NEIGHBOURS, support
from fdslam.localization import localize
from fdslam.obb import Library, joined
from fdslam.progress import single_threaded
from fdslam.sampling import evenly
from fdslam.types import grid_shape

T = TypeVar("T")


def timed(watch: Watch, name: str, work: Callable[[], T]) -> T:
    """Return what the work returns, measured as a stage."""
    with watch.stage(name):
        return work()


def ask(ready: Prepared, trees: Trees, library: Library, query: int, watch: Watch) -> None:
    """Find the change in one query, from its file to CC and EF."""
    context, kept = ready.context, ready.kept
    config, data, bow = context.config, context.dataset, context.bow
    assert bow is not None
    frame = data.query[query]
    image = timed(watch, "decode", lambda: read_image(frame.path))
    size = image.shape[0], image.shape[1]
    keypoints = timed(watch, "ORB", lambda: extract(image, config.bow))
    found = {
        name: timed(
            watch, f"OBBs: {name if name in ('BING', 'YOLO') else 'templates'}", lambda s=source: s.boxes(image)
        )
        for name, source in library.sources.items()
    }
    words = timed(watch, "words", lambda: bow.bag.match(keypoints.descriptors))
    with watch.stage("lists"):
        where = localize(bow.bag, joined(found), keypoints, words, config.bow, bow.placed_words)
    best = where.strong[: config.evaluation.Y].astype(np.int64)
    side = float(np.sqrt(size[0] * size[1]))
    with watch.stage("FD, with word support"):
        near = candidates(best, len(data.map), HYPOTHESES, NEIGHBOURS)
        bits = support(keypoints, side, near, bow.placed_words, config.fd)
        ranks = loc_cells(where.boxes.xyxy, where.ranks[:, best].astype(np.int32), *size, config.fd)
        with_support(ranks, unsupported(keypoints.xy, bits, *size, config.fd), len(data.map), config.fd)
    looks = timed(watch, "looks", lambda: kept.look(image))
    with watch.stage("alignment"):
        images = candidates(best, len(data.map), config.compact.hypotheses, config.compact.neighbours)
        aligned = align(keypoints, size, images, kept.words, kept.size, config.compact)
    with watch.stage("CC, WC and MW"):
        seen = evidence(keypoints, looks, size, aligned, lambda m: kept.looks(data.map[m]), config.compact)
    with watch.stage("EF"):
        trees.loc(features(seen, fd_of(where, best, size, len(data.map), config.fd)), grid_shape(*size))


def table(watch: Watch, queries: int, unit: float) -> str:
    """Return the medians as Markdown; templates are several sources and count together."""
    lines = ["| stage | clock, ms | processor, ms | processor / U |", "|---|---:|---:|---:|"]
    sums = np.zeros(2)
    for name, times in watch.seconds.items():
        each = np.array(times).reshape(queries, -1, 2).sum(axis=1)
        clock, processor = np.median(each, axis=0)
        sums += clock, processor
        lines.append(f"| {name} | {1000 * clock:.1f} | {1000 * processor:.1f} | {processor / unit:.2f} |")
    lines.append(f"| **one query** | {1000 * sums[0]:.1f} | {1000 * sums[1]:.1f} | {sums[1] / unit:.2f} |")
    return "\n".join(lines)


def measure(config: Config, queries: int) -> str:
    """Return the table of the first pair of sessions."""
    ready = next(prepared(config))
    data = ready.context.dataset
    ready.kept.ensure(data.map, "looks of the map")
    trees = trees_of(ready.context, ready.kept)
    library = Library(config.obb)
    ask(ready, trees, library, 0, Watch())  # loads the kernels
    watch, unit = Watch(), unit_seconds(random_descriptors())
    asked = evenly(len(data.query) - 1, queries)
    for query in asked:
        ask(ready, trees, library, query + 1, watch)
    frame = data.query[0]
    head = f"{data.name}: M = {len(data.map)}, {frame.width} × {frame.height}, U = {1000 * unit:.1f} ms"
    return f"{head}, medians of {len(asked)} queries\n\n{table(watch, len(asked), unit)}"


def main() -> None:
    """Print the table."""
    parser = options(__doc__)
    parser.add_argument("--queries", type=int, default=20)
    asked = parser.parse_args()
    single_threaded()
    for folder in asked.folders or [None]:
        print(measure(configuration(folder, asked.yolo, asked.bing, asked.store), asked.queries), flush=True)


if __name__ == "__main__":
    main()
