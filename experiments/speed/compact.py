"""One query in mode best, stage by stage: python -m experiments.speed.compact [DIR …] [--yolo FILE] [--bing FILTERS]

Every stage of the pipeline for queries of every folder or, without one, of the campus, by the functions that the
pipeline calls, in one thread and without the store. The map, its looks and its learner are made first. U is the time of
OpenCV's brute-force 2-NN of 1,490 × 1,490 descriptors in the same process.

``--times 4 16`` asks the same queries again in maps of so many times the images: those added have synthetic words
(synthetic.py), and one that a query is compared with looks like the real image that many images before it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np

from experiments.compact.prepared import Prepared, configuration, options, prepared
from experiments.speed.query import Watch
from experiments.speed.stages import random_descriptors, unit_seconds
from experiments.speed.synthetic import Synthetic
from fdslam.bow.around import candidates
from fdslam.bow.bag import BagOfWords
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
BLOCK = 500  # images that are added at once
GROWING = ("words", "lists")  # stages that look at the whole map


def timed(watch: Watch, name: str, work: Callable[[], T]) -> T:
    """Return what the work returns, measured as a stage."""
    with watch.stage(name):
        return work()


def ask(ready: Prepared, trees: Trees, library: Library, query: int, watch: Watch) -> None:
    """Find the change in one query, from its file to CC and EF."""
    context, kept = ready.context, ready.kept
    config, data, bow = context.config, context.dataset, context.bow
    assert bow is not None
    frame, real, many = data.query[query], len(data.map), bow.bag.index.images
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
        where = localize(bow.bag, joined(found), keypoints, words, config.bow, lambda m: bow.placed_words(m % real))
    best = where.strong[: config.evaluation.Y].astype(np.int64)
    side = float(np.sqrt(size[0] * size[1]))
    with watch.stage("FD, with word support"):
        near = candidates(best, many, HYPOTHESES, NEIGHBOURS)
        bits = support(keypoints, side, near, lambda m: bow.placed_words(m % real), config.fd)
        ranks = loc_cells(where.boxes.xyxy, where.ranks[:, best].astype(np.int32), *size, config.fd)
        with_support(ranks, unsupported(keypoints.xy, bits, *size, config.fd), many, config.fd)
    looks = timed(watch, "looks", lambda: kept.look(image))
    with watch.stage("alignment"):
        images = candidates(best, many, config.compact.hypotheses, config.compact.neighbours)
        of_words, of_size = (lambda m, of=of: of(m % real) for of in (kept.words, kept.size))
        aligned = align(keypoints, size, images, of_words, of_size, config.compact)
    with watch.stage("CC, WC and MW"):
        seen = evidence(keypoints, looks, size, aligned, lambda m: kept.looks(data.map[m % real]), config.compact)
    with watch.stage("EF"):
        trees.loc(features(seen, fd_of(where, best, size, many, config.fd)), grid_shape(*size))


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


def growth(watches: Mapping[int, tuple[Watch, float]]) -> str:
    """Return the processor's time of localisation and of the rest as Markdown.

    Args:
        watches: by the number of map images, what was measured and U.
    """
    lines = ["| M | words / U | lists / U | all the rest / U | one query / U |", "|---:|---:|---:|---:|---:|"]
    for size, (watch, unit) in watches.items():
        queries = len(watch.seconds["decode"])
        every = {name: np.array(times)[:, 1].reshape(queries, -1).sum(axis=1) for name, times in watch.seconds.items()}
        each = [every[name] for name in GROWING]
        each.append(np.sum([times for name, times in every.items() if name not in GROWING], axis=0))
        shown = " | ".join(f"{np.median(times) / unit:.2f}" for times in (*each, np.sum(each, axis=0)))
        lines.append(f"| {size:,} | {shown} |")
    return "\n".join(lines)


def enlarged(bag: BagOfWords, world: Synthetic, images: int) -> None:
    """Add synthetic images to a map until it has so many."""
    while (missing := images - bag.index.images) > 0:
        new, words = world.block(min(BLOCK, missing), len(bag.vocabulary))
        bag.vocabulary.append(new)
        bag.index.add(words, len(bag.vocabulary))


def measure(config: Config, queries: int, times: Sequence[int] = ()) -> str:
    """Return the tables of the first pair of sessions; ``times``: larger maps, in multiples of its own, rising."""
    ready = next(prepared(config))
    data, bow = ready.context.dataset, ready.context.bow
    ready.kept.ensure(data.map, "looks of the map")
    trees = trees_of(ready.context)
    library = Library(config.obb)
    bits, posted = bow.bag.vocabulary.words.descriptors(), [bow.posted(m)[0] for m in range(len(data.map))]
    world = Synthetic.after(bits, posted, np.random.default_rng(0))
    asked, found = evenly(len(data.query) - 1, queries), dict[int, tuple[Watch, float]]()
    for many in (1, *times):
        enlarged(bow.bag, world, many * len(data.map))
        ask(ready, trees, library, 0, Watch())  # loads the kernels
        watch, unit = Watch(), unit_seconds(random_descriptors())
        for query in asked:
            ask(ready, trees, library, query + 1, watch)
        found[bow.bag.index.images] = watch, unit
    frame, (watch, unit) = data.query[0], found[len(data.map)]
    head = f"{data.name}: M = {len(data.map)}, {frame.width} × {frame.height}, U = {1000 * unit:.1f} ms"
    tables = [table(watch, len(asked), unit), *([growth(found)] if times else [])]
    return "\n\n".join([f"{head}, medians of {len(asked)} queries", *tables])


def main() -> None:
    """Print the table."""
    parser = options(__doc__)
    parser.add_argument("--queries", type=int, default=20)
    parser.add_argument("--times", type=int, nargs="*", default=[], help="larger maps, in multiples of the real one")
    asked = parser.parse_args()
    single_threaded()
    for folder in asked.folders or [None]:
        config = configuration(folder, asked.yolo, asked.bing, asked.store)
        print(measure(config, asked.queries, sorted(asked.times)), flush=True)


if __name__ == "__main__":
    main()
