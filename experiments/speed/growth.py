"""How localisation grows to maps of 100,000 images: python -m experiments.speed.growth [--small] [--plot FILE]

The map is synthetic (see synthetic.py): words are appended in bulk, without a search, until it has the size that is
measured; then images and queries of the same kind take the usual way. One thread; CPU time in units of U as in
``experiments.speed.localization``, except loading, in seconds of the clock.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from experiments.speed.localization import REAL, full_and_boxes, load_seconds
from experiments.speed.stages import OBBS, cpu_seconds, random_descriptors, unit_seconds
from experiments.speed.synthetic import Synthetic
from experiments.speed.views import KEYPOINTS, features, places
from fdslam import config
from fdslam.bow.bag import BagOfWords
from fdslam.bow.hamming import GROUP
from fdslam.bow.index import InvertedFile
from fdslam.bow.lists import ranks_of
from fdslam.bow.vocabulary import Vocabulary
from fdslam.bow.words import Words
from fdslam.localization import keypoints_inside
from fdslam.progress import progress, single_threaded

SIZES, SMALL = (1000, 3000, 10_000, 30_000, 100_000), (250, 500, 1000)
REAL_IMAGES, BLOCK, ADDED, QUERIES = 300, 500, 8, 4


@dataclass
class Grown:
    """One map size; times in seconds of CPU."""

    size: int
    words: int
    add: float  # one image, from descriptors to postings
    upkeep: float  # per image: new pivots, putting words in order and merging postings, spread over all images
    anew: float  # once: choosing pivots from all words and putting each into its list
    search: float  # words of a query
    scores: float  # of the full image and 64 OBBs
    ranks: float
    megabytes: float
    load: float  # wall time, checksum included

    @property
    def query(self) -> float:
        """From descriptors to all ranks."""
        return self.search + self.scores + self.ranks


def _once(work: Callable[[], object]) -> float:
    begin = time.thread_time()
    work()
    return time.thread_time() - begin


def _anew(words: Words, bits: np.ndarray) -> float:
    """Return the seconds of choosing pivots from all words and putting each into its list."""
    return _once(lambda: Words(len(bits), GROUP * words.depth).append(bits))


def _upkeep(vocabulary: Vocabulary, index: InvertedFile, anew: float) -> float:
    """Return seconds per image of what is done now and then.

    The pool is put in order whenever it has grown by a tenth, postings move log₂ M times, and pivots were chosen anew
    from half, a quarter, … of the words that they were chosen from last. Each is done once now and counted as often as
    it was done on the way here.
    """
    order = _once(vocabulary.words.arrays)  # puts the words in order
    merge = _once(index.remerged)
    chosen = 2 * anew * vocabulary.words.chosen_from / len(vocabulary.words)
    return (order / 0.1 + merge * math.log2(index.images) + chosen) / index.images


def at_size(vocabulary: Vocabulary, index: InvertedFile, world: Synthetic) -> Grown:
    """Measure the map as it is now."""
    boxes = full_and_boxes()
    bits = vocabulary.words.descriptors()
    views = [world.view(bits) for _ in range(ADDED + QUERIES)]
    anew = _anew(vocabulary.words, bits)
    del bits
    search, scores, ranks = [], [], []
    for view in views[ADDED:]:
        inside = keypoints_inside(boxes, view.xy)
        words = vocabulary.match(view.descriptors)
        found = index.scores(words, inside, "ibow")
        search.append(cpu_seconds(lambda d=view.descriptors: vocabulary.match(d), repeat=2))
        scores.append(cpu_seconds(lambda w=words, i=inside: index.scores(w, i, "ibow"), repeat=2))
        ranks.append(cpu_seconds(lambda f=found: ranks_of(f, "last"), repeat=2))
    size, count = index.images, len(vocabulary)
    kept = (vocabulary.nbytes + index.nbytes) / 1e6

    def add(descriptors: np.ndarray) -> None:
        words = vocabulary.learn(descriptors)
        index.add([words], len(vocabulary))

    added = [_once(lambda d=view.descriptors: add(d)) for view in views[:ADDED]]
    upkeep = _upkeep(vocabulary, index, anew)
    means = [float(np.mean(times)) for times in (search, scores, ranks)]
    return Grown(
        size,
        count,
        float(np.mean(added)),
        upkeep,
        anew,
        *means,
        kept,
        load_seconds(BagOfWords(vocabulary, index), views[-1]),
    )


def grow(sizes: tuple[int, ...]) -> list[Grown]:
    """Grow one map and measure it at every size."""
    learned = Vocabulary(config.Vocabulary())
    base = places(REAL)
    for one in progress(features(base.map, range(REAL_IMAGES), 0), REAL_IMAGES, "words of real images"):
        learned.learn(one.descriptors)
    world = Synthetic(learned.words.descriptors(), KEYPOINTS, np.random.default_rng(0))
    vocabulary, index, measured = Vocabulary(config.Vocabulary()), InvertedFile([], 0), []
    for size in progress(sizes, len(sizes), "map sizes"):
        while index.images < size:
            new, images = world.block(min(BLOCK, size - index.images), len(vocabulary))
            vocabulary.append(new)
            index.add(images, len(vocabulary))
        measured.append(at_size(vocabulary, index, world))
    return measured


def table(unit: float, rows: list[Grown]) -> str:
    """Return the measurements as Markdown."""
    lines = [
        "| M | words | full + 64 lists | of it words | scores | ranks | add | upkeep | KB / image | MB | load | anew |",
        "|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for row in rows:
        times = (row.query, row.search, row.scores, row.ranks, row.add, row.upkeep)
        shown = " | ".join(f"{seconds / unit:.2f} U" for seconds in times)
        kept = f"{1000 * row.megabytes / row.size:.1f} | {row.megabytes:.0f}"
        lines.append(f"| {row.size} | {row.words} | {shown} | {kept} | {row.load:.2f} s | {row.anew:.1f} s |")
    return "\n".join(lines)


def plot(unit: float, rows: list[Grown], path: Path) -> None:
    """Draw query, build, memory and load against M."""
    sizes = [row.size for row in rows]
    figure, axes = plt.subplots(2, 2, figsize=(9, 6.5), sharex=True)
    panels = {
        "query: full image + 64 lists, U": {
            "together": [row.query / unit for row in rows],
            "words": [row.search / unit for row in rows],
            "scores": [row.scores / unit for row in rows],
            "ranks": [row.ranks / unit for row in rows],
        },
        "adding an image, U": {
            "add": [row.add / unit for row in rows],
            "upkeep": [row.upkeep / unit for row in rows],
        },
        "map, MB": {"words and postings": [row.megabytes for row in rows]},
        "loading, s": {"checksum included": [row.load for row in rows]},
    }
    for axis, (title, curves) in zip(axes.flat, panels.items(), strict=True):
        for name, values in curves.items():
            axis.loglog(sizes, values, marker="o", label=name)
        axis.set_title(title)
        axis.grid(which="both", alpha=0.3)
        axis.legend()
    for axis in axes[1]:
        axis.set_xlabel("map images M")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    """Print the table; draw it where --plot says."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--small", action="store_true", help=f"maps of {SMALL} images instead of {SIZES}")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="also draw the curves there, as PNG")
    arguments = parser.parse_args()
    single_threaded()
    descriptors = random_descriptors()
    unit = unit_seconds(descriptors)
    rows = grow(SMALL if arguments.small else SIZES)
    unit = min(unit, unit_seconds(descriptors))
    print(f"U = {1000 * unit:.1f} ms; {KEYPOINTS} keypoints, {OBBS} OBBs\n\n{table(unit, rows)}")
    if arguments.plot:
        plot(unit, rows, arguments.plot)


if __name__ == "__main__":
    main()
