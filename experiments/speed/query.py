"""One query of the paper's size in a map of the paper's size: python -m experiments.speed.query [--memory 1000]

FD, PC, AD, their fusion and the mask by the pipeline's own stages, with everything they read and store. The queries are
campus views of 1232 × 1616. The map is 2,959 images large without rendering them: its words are synthetic
(``synthetic.py``) around those of a dozen views, its SIFTs are those views', and its autoencoders see them small, for
one epoch, which makes them wrong but no faster. Stages run one after the other, in one thread or, where ``--threads``
says so and the stage can, in several; seconds are of the clock and, as other work may run on the machine, of the
processor. Word support, which mode ``paper`` does without, is a row of its own: the best hypothesis then shows the
query's place, and the words of an image are its keypoints.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from experiments.speed.stages import random_descriptors, unit_seconds
from experiments.speed.synthetic import Synthetic
from fdslam import config as settings
from fdslam.bow.around import candidates
from fdslam.bow.bag import BagOfWords
from fdslam.bow.index import InvertedFile
from fdslam.bow.orb import extract
from fdslam.bow.vocabulary import Vocabulary
from fdslam.config import Config
from fdslam.context import Context, Words
from fdslam.data.campus import World
from fdslam.data.images import read_image
from fdslam.detectors import comparison, support
from fdslam.detectors.registry import DETECTORS
from fdslam.fusion import fuse
from fdslam.harris_laplace import harris_laplace, sift
from fdslam.hypotheses import hypotheses
from fdslam.keypoints import FEATURES
from fdslam.mapping import BowMap
from fdslam.mask import apply_masks, load_masks, segmentation
from fdslam.obb import Library
from fdslam.progress import single_threaded
from fdslam.proposals import Proposals
from fdslam.store import Arrays, Store
from fdslam.types import Dataset, Features, Frame

IMAGES, HEIGHT, WIDTH = 2959, 1616, 1232
VIEWS, BLOCK, SMALLER = 12, 500, 4  # SMALLER: times, what the autoencoders are trained on
QUERIES = 12
SUPPORT = "word support, of mode tuned"
RESIDENT = (100, 500, 1000)  # queries after which the memory is looked at


def configuration(store: Path, threads: int) -> Config:
    """Return the paper's configuration with the shipped models, and autoencoders that are trained for one epoch."""
    base = Config()
    return Config(
        store=str(store),
        workers=1,
        obb=replace(base.obb, library="J+B+BING+YOLO", yolo=replace(base.obb.yolo, threads=threads)),
        mask=replace(base.mask, source="deeplabv3plus", threads=threads),
        mix=replace(base.mix, rows=["FD+AD+PC"]),
        ad=replace(base.ad, places="time", epochs=1, folds=2),
        pc=replace(base.pc, threads=threads),
    )


@dataclass(frozen=True)
class Seen(Words):
    """A map whose words are the keypoints of its images."""

    robot: Robot

    def keypoints(self, frame: Frame) -> Features:
        """Return the keypoints of a query."""
        return self.robot.bow.keypoints(frame)

    def placed_words(self, image: int) -> Features:
        """Return the keypoints of a map image, which are stored."""
        return self.robot.bow.features.load(self.robot.dataset.map[image])


class Robot:
    """A map of ``images`` images, and queries in it. Every query is new: nothing of it is stored yet."""

    def __init__(self, folder: Path, images: int, height: int, width: int, threads: int) -> None:
        self.config, self.store = configuration(folder / "store", threads), Store(folder / "store")
        self.shape, self.asked = (height, width), 0
        world = World(0, images, width, height)
        places = np.linspace(0, min(world.count.values()) - 1, min(VIEWS, min(world.count.values()))).astype(int)
        self.views = [self._written(folder / f"{i}.tiff", world.view("AU", int(p)).image) for i, p in enumerate(places)]
        seen = [world.view("SU", int(p)).image for p in places]
        size = max(width // SMALLER, 16), max(height // SMALLER, 16)
        small = [
            self._written(folder / f"map{i}.tiff", np.asarray(cv2.resize(one, size, interpolation=cv2.INTER_AREA)))
            for i, one in enumerate(seen)
        ]
        self.sifts = [self._sift(one) for one in seen]
        frames = tuple(self._frame(f"map/{i}", small[i % len(small)], height, width) for i in range(images))
        times = np.arange(images, dtype=float)
        self.dataset = Dataset("benchmark", frames, (), None, None, None, None, times)
        self.library = Library(self.config.obb)
        self.parts = {n: Library(replace(self.config.obb, library=n)) for n in ("BING", "YOLO")}
        self.segmentation = segmentation(self.config.mask, "cpu")
        self.bow = BowMap(frames, self.config.bow, self.library, self.store, 1)
        self.orbs = [extract(one, self.config.bow) for one in seen]
        bits = np.concatenate([one.descriptors for one in self.orbs])
        self.bow.bag = synthetic_bag(bits, images, self.config.bow.features)

    @staticmethod
    def _written(path: Path, image: np.ndarray) -> Path:
        cv2.imwrite(str(path), image[..., ::-1], [cv2.IMWRITE_TIFF_COMPRESSION, 1])  # none, as NCLT's
        return path

    @staticmethod
    def _frame(name: str, path: Path, height: int, width: int) -> Frame:
        return Frame(name, path, hashlib.sha256(name.encode()).hexdigest(), height, width)

    def _sift(self, image: np.ndarray) -> Arrays:
        keypoints = harris_laplace(image, self.config.pc)
        return {"xy": keypoints.xy, "sift": sift(image, keypoints).astype(np.uint8)}

    def next(self) -> Frame:
        """Return a query that has not been asked yet."""
        self.asked += 1
        return self._frame(f"query/{self.asked}", self.views[self.asked % len(self.views)], *self.shape)

    def ask(self, watch: Watch, together: int = 1) -> list[np.ndarray]:
        """Return the fused and masked cells of the next queries; ``watch`` measures the stages.

        What a stage reads of the map it reads once for all that are asked together.
        """
        frames, config = [self.next() for _ in range(together)], self.config
        with watch.stage("ORB"):
            self.bow.features.ensure(frames, "")
        for name, library in self.parts.items():
            with watch.stage(f"OBBs: {name}"):
                Proposals(library, self.store, 1).ensure(frames, "")
        with watch.stage("words"):
            for frame in frames:
                self.bow.words(frame)
        with watch.stage("weak lists and strong list"):
            keys, found = self.bow.localize(frames)
        dataset = replace(self.dataset, query=tuple(frames))
        places = hypotheses(config.evaluation, dataset, found)
        for m in np.unique(np.concatenate(places)):  # the map's descriptors, which building it would have left
            key = comparison.features_key(dataset.map[m], config.pc)
            if not self.store.has(comparison.FEATURES, key):
                self.store.put(comparison.FEATURES, key, self.sifts[m % len(self.sifts)])
        context = Context(config, dataset, self.store, tuple(found), tuple(keys), places)
        maps = []
        for name in config.mix.detectors:
            with watch.stage(name):
                maps.append(list(DETECTORS[name].detect(context).loc))
        with watch.stage("mask"):
            masks = load_masks(dataset, config.mask, self.segmentation, self.store, 1)
        with watch.stage("fusion"):
            fused = apply_masks(fuse(maps, config.mix.rule), masks)
        self._support(context, watch)
        return fused

    def _support(self, context: Context, watch: Watch) -> None:
        """Look for the words that support the queries' keypoints, the best hypothesis being right."""
        places, frames = [], context.dataset.map
        for frame, best in zip(context.dataset.query, context.hypotheses, strict=True):
            right = int(frame.name.split("/")[1]) % len(self.views)
            places.append(np.array([right, *best[1:]]))
            near = candidates(places[-1], len(frames), support.HYPOTHESES, support.NEIGHBOURS)
            for m in near:  # what building the map would have left
                key = self.bow.features.key(frames[m])
                if not self.store.has(FEATURES, key):
                    orb = self.orbs[m % len(self.orbs)]
                    self.store.put(FEATURES, key, {"xy": orb.xy, "descriptors": orb.descriptors})
        with watch.stage(SUPPORT):
            support.word_support(replace(context, hypotheses=tuple(places), bow=Seen(self)))


class Watch:
    """Seconds of the clock and of the processor, per stage and query."""

    def __init__(self) -> None:
        self.seconds: dict[str, list[tuple[float, float]]] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure what happens inside."""
        clock, processor = time.perf_counter(), time.process_time()
        yield
        passed = time.perf_counter() - clock, time.process_time() - processor
        self.seconds.setdefault(name, []).append(passed)

    def medians(self) -> dict[str, tuple[float, float]]:
        """Return the medians over the queries."""
        return {name: tuple(np.median(times, axis=0).tolist()) for name, times in self.seconds.items()}


def synthetic_bag(real: np.ndarray, images: int, keypoints: int) -> BagOfWords:
    """Return a map of so many images with words like the real ones, uint8 [n, 32]."""
    world = Synthetic(real, keypoints, np.random.default_rng(0))
    vocabulary, index = Vocabulary(settings.Vocabulary()), InvertedFile([], 0)
    while index.images < images:
        new, words = world.block(min(BLOCK, images - index.images), len(vocabulary))
        vocabulary.append(new)
        index.add(words, len(vocabulary))
    return BagOfWords(vocabulary, index)


def resident() -> float:
    """Return the MB of memory that this process holds now."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def quietly(work: Callable[[], object]) -> None:
    """Do the work without its lines of progress."""
    with Path(os.devnull).open("w") as nowhere, redirect_stderr(nowhere):
        work()


def table(alone: Watch, many: Watch, together: int, decode: tuple[float, float], unit: float) -> str:
    """Return the measurements as Markdown."""
    rows = {
        name: (*times, many.medians()[name][1] / together, times[1] / unit) for name, times in alone.medians().items()
    }
    beside = rows.pop(SUPPORT)
    rows["**one query**"] = tuple(sum(column) for column in zip(*rows.values(), strict=True))
    rows[SUPPORT] = beside
    rows["decoding its file once"] = (*decode, decode[1], decode[1] / unit)
    lines = [
        f"| stage | clock, ms | processor, ms | one of {together} asked together, processor, ms | alone / U |",
        "|---|---:|---:|---:|---:|",
    ]
    for name, (clock, processor, shared, units) in rows.items():
        lines.append(f"| {name} | {1000 * clock:.1f} | {1000 * processor:.1f} | {1000 * shared:.1f} | {units:.2f} |")
    return "\n".join(lines)


def measure(robot: Robot, queries: int, say: Callable[[str], None]) -> None:
    """Print the table."""
    unit = unit_seconds(random_descriptors())
    quietly(lambda: robot.ask(Watch()))  # trains the autoencoders, loads the kernels
    alone, many, decoding = Watch(), Watch(), Watch()
    for _ in range(queries):
        quietly(lambda: robot.ask(alone))
        view = robot.views[(robot.asked + 2) % len(robot.views)]  # neither the last nor the next, or it is remembered
        with decoding.stage("decode"):
            read_image(view)
    quietly(lambda: robot.ask(many, queries))
    say(f"U = {1000 * unit:.1f} ms; M = {len(robot.dataset.map)}, medians of {queries} queries\n")
    say(table(alone, many, queries, decoding.medians()["decode"], unit))


def remember(robot: Robot, queries: int, say: Callable[[str], None]) -> None:
    """Print the memory after so many queries."""
    say("\n| queries | resident, MB |\n|---:|---:|")
    for done in range(1, queries + 1):
        quietly(lambda: robot.ask(Watch()))
        if done in (*RESIDENT, queries):
            say(f"| {done} | {resident():.0f} |")


def main() -> None:
    """Print the stages of a query and, with --memory, what many queries hold."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--images", type=int, default=IMAGES, help="of the map")
    parser.add_argument("--height", type=int, default=HEIGHT, help="pixels")
    parser.add_argument("--width", type=int, default=WIDTH, help="pixels")
    parser.add_argument("--queries", type=int, default=QUERIES, help="measured")
    parser.add_argument("--memory", type=int, default=0, metavar="N", help="also ask N more queries")
    parser.add_argument("--threads", type=int, default=1, help="of the models and of PC's comparison")
    asked = parser.parse_args()
    single_threaded()
    with tempfile.TemporaryDirectory() as folder:
        robot = Robot(Path(folder), asked.images, asked.height, asked.width, asked.threads)
        measure(robot, asked.queries, print)
        if asked.memory:
            remember(robot, asked.memory, print)


if __name__ == "__main__":
    main()
