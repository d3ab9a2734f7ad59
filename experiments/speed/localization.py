"""Localisation in a growing map, in one run: python -m experiments.speed.localization [--small] [--json FILE]

CPU time of one thread, in units of U, the time of OpenCV's brute-force Hamming 2-NN of 1490 × 1490 descriptors in the
same run. The map is built from real photographs, or from campus views where there are none, seen again and again under
random homographies and photometric changes (see views.py); queries are other photographs of the same places.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from experiments.speed import kernels, verification
from experiments.speed.stages import OBBS, cpu_seconds, random_boxes, random_descriptors, unit_seconds
from experiments.speed.views import HEIGHT, KEYPOINTS, WIDTH, features, places
from fdslam import config
from fdslam.bow import hamming
from fdslam.bow.bag import BagOfWords
from fdslam.bow.index import InvertedFile
from fdslam.bow.lists import ranks_of
from fdslam.bow.vocabulary import Vocabulary
from fdslam.bow.words import Words
from fdslam.localization import keypoints_inside, strong_list
from fdslam.progress import progress, single_threaded
from fdslam.types import Features

REAL = Path(__file__).parents[3] / "shared" / "data"
SIZES, SMALL = (250, 500, 1000, 2000, 3000), (50, 100, 200)
QUERIES, EXACT_QUERIES, VERIFIED = 12, 6, 3
# What the C++ costs (iBoW-LCD), measured once elsewhere in the same unit: full image + 64 lists, adding an image.
CPP = {250: (147, 10), 500: (173, 12), 1000: (233, 15), 2000: (273, 19), 3000: (232, 21)}


@dataclass
class Measured:
    """One map size; times in seconds of CPU."""

    size: int
    words: int
    lists: float  # full image + 64 OBBs, from descriptors to complete ranks
    search: float  # of it, the search of words
    strong: float  # beside it: the strong list of those ranks
    add: float  # one image, from descriptors to postings: mean over the map's last doubling, with all upkeep
    slowest: float  # of those
    bytes_per_image: float
    recall: float  # word recall@1 against exact search
    load: float = field(default=0.0)  # wall time of loading the map, checksum included


def localize(bag: BagOfWords, query: Features, boxes: np.ndarray) -> np.ndarray:
    """Return the ranks of all map images in the list of every box, int32 [J, M], from descriptors and positions."""
    words = bag.match(query.descriptors)
    return ranks_of(bag.scores(words, keypoints_inside(boxes, query.xy), "ibow"), "last")


def word_recall(words: Words, queries: list[Features]) -> float:
    """Return the share of keypoints for which the search returns the very word that exact search returns."""
    exact = hamming.pack(words.descriptors())
    hits = [
        words.two_nearest(q.descriptors)[:, 0] == hamming.two_nearest_keys(*exact, q.descriptors)[:, 0] for q in queries
    ]
    return float(np.concatenate(hits).mean())


def load_seconds(bag: BagOfWords, query: Features) -> float:
    """Return the wall time from a saved map to its first answer; the file lies in the system's cache."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map"
        bag.save(path)
        begin = time.perf_counter()
        localize(BagOfWords.load(path), query, full_and_boxes()[:1])
        return time.perf_counter() - begin


def full_and_boxes() -> np.ndarray:
    """Return the full image and the OBBs, float32 [1 + OBBS, 4] xyxy pixels."""
    return np.concatenate([[[0, 0, WIDTH, HEIGHT]], random_boxes(np.random.default_rng(0))]).astype(np.float32)


def at_size(bag: BagOfWords, times: list[float], queries: list[Features]) -> Measured:
    """Measure the map as it is now; ``times`` are the seconds of adding each of its images."""
    boxes = full_and_boxes()
    ranks = [localize(bag, q, boxes) for q in queries]
    lists = np.mean([cpu_seconds(lambda q=q: localize(bag, q, boxes)) for q in queries])
    search = np.mean([cpu_seconds(lambda q=q: bag.match(q.descriptors)) for q in queries])
    strong = np.mean([cpu_seconds(lambda r=r: strong_list(r)) for r in ranks])
    last = times[len(times) // 2 :]
    return Measured(
        size=len(times),
        words=len(bag.vocabulary),
        lists=float(lists),
        search=float(search),
        strong=float(strong),
        add=float(np.mean(last)),
        slowest=max(last),
        bytes_per_image=bag.nbytes / len(times),
        recall=word_recall(bag.vocabulary.words, queries[:EXACT_QUERIES]),
        load=load_seconds(bag, queries[0]),
    )


def verify(bag: BagOfWords, queries: list[Features], images: list[Features]) -> verification.Verification:
    """Measure geometric verification in the map as it is now."""
    measured = []
    for query in progress(queries, len(queries), "verification"):
        inside = keypoints_inside(full_and_boxes(), query.xy)
        measured.append(verification.measure(query, bag.scores(bag.match(query.descriptors), inside, "ibow"), images))
    return verification.mean(measured)


def grow(sizes: tuple[int, ...]) -> tuple[str, list[Measured], verification.Verification]:
    """Build the map image by image and measure it at every size; verification at the last."""
    base = places(REAL)
    step = max(len(base.query) // QUERIES, 1)
    found = (next(features(base.query, range(i, i + 1), 1)) for i in range(0, len(base.query), step))
    queries = [q for q in found if len(q.xy) == KEYPOINTS][:QUERIES]
    bag = BagOfWords(Vocabulary(config.Vocabulary()), InvertedFile([], 0))
    times: list[float] = []
    measured: list[Measured] = []
    images: list[Features] = []
    for one in progress(features(base.map, range(sizes[-1]), 0), sizes[-1], "map images"):
        begin = time.thread_time()
        bag.add(one.descriptors)
        times.append(time.thread_time() - begin)
        images.append(one)
        if len(times) in sizes:
            measured.append(at_size(bag, times, queries))
    return base.name, measured, verify(bag, queries[:VERIFIED], images)


def table(unit: float, rows: list[Measured]) -> str:
    """Return the measurements as Markdown."""
    lines = [
        "| M | words | full + 64 lists | of it word search | C++ | strong list | add | slowest | C++ | KB / image "
        "| word recall@1 | load |",
        "|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for row in rows:
        cpp = CPP.get(row.size, ("", ""))
        times = (row.lists, row.search, row.strong, row.add)
        lists, search, strong, add = (f"{seconds / unit:.2f} U" for seconds in times)
        lines.append(
            f"| {row.size} | {row.words} | {lists} | {search} | {cpp[0]} | {strong} | {add} | {row.slowest:.1f} s "
            f"| {cpp[1]} | {row.bytes_per_image / 1000:.1f} | {row.recall:.3f} | {row.load:.2f} s |"
        )
    return "\n".join(lines)


def figures(unit: float, rows: list[Measured], checked: verification.Verification) -> dict[str, object]:
    """Return what a machine reads: the last row, and how the time grows from the first."""
    last = rows[-1]
    return {
        "U_ms": 1000 * unit,
        "lists64_U": last.lists / unit,
        "lists64_growth_250_to_3000": last.lists / rows[0].lists if (rows[0].size, last.size) == (250, 3000) else None,
        "add_U": last.add / unit,
        "bytes_per_image": last.bytes_per_image,
        "word_recall_at_1": last.recall,
        "verify_speedup": checked.one_by_one / checked.together,
        "verify_speedup_own_lists": checked.own_one_by_one / checked.own,
        "add_slowest_s": last.slowest,
        "strong_list_U": last.strong / unit,
        "load_s": last.load,
        "map_sizes": [row.size for row in rows],
    }


def main() -> None:
    """Print the table; write the figures where --json says."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--small", action="store_true", help=f"maps of {SMALL} images instead of {SIZES}")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures there")
    arguments = parser.parse_args()
    single_threaded()
    descriptors = random_descriptors()
    unit = unit_seconds(descriptors)
    name, rows, checked = grow(SMALL if arguments.small else SIZES)
    unit = min(unit, unit_seconds(descriptors))
    print(f"U = {1000 * unit:.1f} ms; {name} of {WIDTH} × {HEIGHT}, {KEYPOINTS} keypoints, {OBBS} OBBs\n")
    print(table(unit, rows))
    print(f"\n{verification.table(unit, checked)}")
    compiled, loaded = kernels.seconds()
    print(f"\ncompiled kernels: {compiled:.1f} s in the first process that uses them, {loaded:.2f} s in the next")
    if arguments.json:
        arguments.json.write_text(json.dumps(figures(unit, rows, checked), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
