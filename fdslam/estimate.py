"""What a run will take, stage by stage, said before it starts: time, disk and memory, less what is stored already.

The rates are seconds of one core, measured with the default settings; experiments/speed/README.md shows how far the
estimates were from what runs took. The core at hand is compared with that one by a task of a few milliseconds.
"""

from __future__ import annotations

import logging
import math
import os
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np

from fdslam.config import Config
from fdslam.controls import CONTROLS
from fdslam.data import Outline
from fdslam.errors import InputError
from fdslam.obb import expected_boxes
from fdslam.progress import readable, say, worker_count
from fdslam.store import Store
from fdslam.todo import Todo
from fdslam.types import grid_shape

log = logging.getLogger(__name__)
REFERENCE = 0.0073  # seconds of ``_task`` on the core whose rates these are
LIBRARIES = 0.5e9  # bytes of the interpreter with all that it imports
POOL = 55  # bytes a cell while a row is fused and measured, beside the LoC of the detectors
SIFTS, ORBS = 205e3, 75e3  # bytes of an image on disk: 1,500 SIFTs; 1,500 ORBs with their words and postings
SHOWN = 1e5  # bytes of a query in the page


@dataclass(frozen=True)
class Line:
    """One stage, named as in ``run.json``."""

    stage: str
    what: str
    seconds: float  # of wall-clock time
    disk: float  # bytes written
    memory: float  # bytes at most, the libraries included


@dataclass(frozen=True)
class Estimate:
    """All stages of a run."""

    lines: tuple[Line, ...]
    workers: int

    @property
    def seconds(self) -> float:
        """Wall-clock time of all stages."""
        return sum(line.seconds for line in self.lines)

    @property
    def disk(self) -> float:
        """Bytes that are written."""
        return sum(line.disk for line in self.lines)

    @property
    def memory(self) -> float:
        """Bytes at most."""
        return max(line.memory for line in self.lines)

    def text(self, stored: bool) -> str:
        """Return the table for people; ``stored``: what is stored is left out."""
        total = Line("all", "", self.seconds, self.disk, self.memory)
        rows = [("stage", "to do", "time", "disk", "memory")]
        for one in (*self.lines, total):
            rows.append((one.stage, one.what, _span(one.seconds), readable(one.disk), readable(one.memory)))
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        sides = "<<>>>"
        aligned = [
            "  ".join(f"{cell:{side}{width}}" for cell, side, width in zip(row, sides, widths, strict=True)).rstrip()
            for row in rows
        ]
        cores = "one core" if self.workers == 1 else f"{self.workers} cores"
        less = "less what is stored already" if stored else "if nothing that follows is stored"
        return "\n".join([f"about, on {cores} with nothing else to do, {less}:", *aligned])


def estimate(config: Config, sizes: Outline, todo: Todo) -> Estimate:
    """Return what a run will take.

    Args:
        config: of the run.
        sizes: of its data sets.
        todo: what is not stored.
    """
    plan = _Plan(config, sizes, todo)
    stages = [plan.data(), plan.localisation()]
    stages += [plan.detectors[name]() for name in plan.names]
    lines = (*stages, plan.evaluation(), plan.pictures())
    slower = _task() / REFERENCE
    return Estimate(tuple(replace(line, seconds=slower * line.seconds) for line in lines), plan.workers)


class _Plan:
    """The rates. Seconds are those of the reference core."""

    def __init__(self, config: Config, sizes: Outline, todo: Todo) -> None:
        self.config, self.sizes, self.todo = config, sizes, todo
        self.workers = worker_count(config.workers)
        self.pixels = sizes.height * sizes.width
        self.read = 0.003 + 0.028e-6 * self.pixels  # seconds of decoding an image
        # A pair without queries is refused by the loader, in better words than a division by 0.
        self.queries, self.longest = max(1, sum(q for q, _ in sizes.pairs)), max(m for _, m in sizes.pairs)
        self.cells = self.queries * math.prod(grid_shape(sizes.height, sizes.width))
        self.result = 4.2 * self.cells / self.queries  # bytes of a detector's result of a query on disk
        self.obbs = expected_boxes(config.obb)
        self.ranks = 2.0 * self.obbs * sum(q * m for q, m in sizes.pairs)  # bytes of the weak lists
        self.names = config.mix.detectors
        sets = 2 if {*config.evaluation.curve_Y} - {config.evaluation.Y} else 1  # of LoC, at one Y and at another
        loc = sets * self.cells * sum(8 if name == "AD" else 4 for name in self.names)
        self.kept = LIBRARIES + self.ranks + loc
        self.detectors: dict[str, Callable[[], Line]] = {
            "FD": self.fault_diagnosis,
            "PC": self.comparison,
            "AD": self.anomaly,
        }
        self.detectors |= {name: partial(self.compact, name) for name in ("CC", "WC", "MW")} | {"EF": self.early}

    def data(self) -> Line:
        each = 0.013 + 0.48e-6 * self.pixels if self.config.dataset.kind == "campus" else self.read + 4e-8 * self.pixels
        memory = LIBRARIES + (self.workers * 90.0 * self.pixels if self.todo.make else 0)
        seconds = (self.todo.make * each + self.todo.masks * (self.read + 0.25)) / self.workers
        masks = f", {self.todo.masks:,} masks" if self.todo.masks else ""
        what = f"{self.todo.make:,} images to make{masks}"
        return Line("data", what, seconds, self.todo.make * 2.0 * self.pixels, memory)

    def localisation(self) -> Line:
        todo, enlarged = self.todo, self._enlarged(self.config.bow.min_side)
        features = todo.features * (self.read + 0.0055 + 1.33e-8 * enlarged)
        boxes = todo.boxes * (self.read + 0.02 + 3e-8 * self.pixels)
        asked = todo.localise * (self.read + 0.02 + 3e-7 * self.obbs * self.longest)
        lists = (self.ranks + 8.0 * self.queries * self.longest) * todo.localise / self.queries
        return Line(
            "map and localisation",
            f"{todo.learn:,} map images, {todo.localise:,} queries",
            (features + boxes + asked) / self.workers + 0.02 * todo.learn,
            ORBS * (todo.features + todo.learn) + lists,
            LIBRARIES + self.ranks + 0.13e6 * self.longest + self.workers * 40.0 * enlarged,
        )

    def fault_diagnosis(self) -> Line:
        count, words = self.todo.fd, self.todo.support
        seconds = (0.006 * count + 0.15 * words) / self.workers
        return Line("FD", f"{count:,} queries", seconds, count * self.result + 3e3 * words, self.kept)

    def comparison(self) -> Line:
        todo, enlarged = self.todo, self._enlarged(self.config.pc.min_side)
        seconds = todo.sift * (self.read + 0.063 + 1.13e-7 * enlarged) + todo.pc * 0.004 * self.config.evaluation.Y
        return Line(
            "PC",
            f"SIFTs of up to {todo.sift:,} images, {todo.pc:,} queries",
            seconds / self.workers,
            todo.sift * SIFTS + todo.pc * self.result,
            self.kept + self.workers * 120.0 * enlarged,
        )

    def anomaly(self) -> Line:
        todo, ad = self.todo, self.config.ad
        step = 0.0046 * (ad.pixels / 12_288) * (ad.channels / 16)  # seconds of training on an image once
        seconds = todo.train * (self.read + 0.95 * ad.epochs * (ad.folds + 0.3) * step) + todo.ad * (self.read + 0.02)
        places = len(self.sizes.maps) * ad.k * todo.train / sum(self.sizes.maps)
        weights = ad.latent * ad.channels * ad.pixels / 4 + 1.1e6 * (ad.channels / 16) ** 2  # bytes
        memory = self.workers * (0.3e9 + 12.0 * ad.pixels * self.longest / ad.k)
        if ad.together(self.config.device):  # all folds of all places, each with Adam's state and a gradient
            memory = 0.3e9 + 12.0 * ad.pixels * self.longest * (1 + ad.folds) + 5 * weights * ad.k * ad.folds
        return Line(
            "AD",
            f"AEs for {todo.train:,} map images, {todo.ad:,} queries",
            seconds / self.workers,
            places * weights + todo.ad * self.result,
            self.kept + memory,
        )

    def compact(self, name: str) -> Line:
        todo = self.todo
        if name != self.config.mix.compact[0]:  # the first has found what all of them need
            return Line(name, f"{self.queries:,} queries", 0.0, 0.0, self.kept)
        seconds = todo.looks * (self.read + 0.03) + todo.evidence * 0.16
        disk = 1000 * self.config.compact.kilobytes * todo.looks + 7 * self.result * todo.evidence
        what = f"looks of {todo.looks:,} images, {todo.evidence:,} queries"
        return Line(name, what, seconds / self.workers, disk, self.kept + 7 * self.result * self.queries)

    def early(self) -> Line:
        todo = self.todo
        alone = self.config.mix.compact == ["EF"]
        first = self.compact("EF") if alone else Line("EF", "", 0.0, 0.0, self.kept)
        rows = 128.0 * self.result / 4.2  # bytes of an image's features
        seconds = todo.pretend * (self.read + 0.45) / self.workers + 0.06 * todo.pretend + 0.02 * self.queries
        what = f"{todo.pretend:,} made-up changes, {self.queries:,} queries"
        memory = first.memory + 3 * rows * todo.pretend
        return Line("EF", what, first.seconds + seconds, first.disk + rows * todo.pretend, memory)

    def evaluation(self) -> Line:
        methods, measured = len(self.config.mix.rows), self.config.evaluation
        tables = 2 if len(self.sizes.pairs) > 1 else 1  # of all pairs together, and of each
        others = methods * len({*measured.curve_Y} - {measured.Y})
        each = (methods + len(CONTROLS) + 1) * tables * (3e-7 + 3.5e-10 * measured.bootstrap) + others * 3.5e-7
        cells = self.cells if self.sizes.annotated else 0
        return Line("fusion and evaluation", f"{cells:,} cells", each * cells, 0.0, self.kept + POOL * cells)

    def pictures(self) -> Line:
        report = self.config.report
        count, methods = min(2 * report.pictures, self.queries), len(self.config.mix.rows)
        shown = min(self.queries, round(1e6 * report.megabytes / SHOWN)) if report.page else 0
        seconds = 0.5 * count + (6e-7 * self.cells * methods if count or shown else 0)
        seconds += 1.5 + shown * (0.012 + 5e-8 * self.pixels) if report.page else 0
        memory = self.kept + (POOL * self.cells if count or shown else 0)
        what = " and ".join([f"{count}"] * bool(count or not shown) + [f"a page of {shown}"] * bool(shown))
        return Line("pictures", what, seconds, 6e5 * count + SHOWN * shown, memory)

    def _enlarged(self, min_side: int) -> float:
        """Return the pixels of an image after what is small has been upscaled."""
        return self.pixels * max(1.0, min_side / min(self.sizes.height, self.sizes.width)) ** 2


def announce(config: Config, sizes: Outline, todo: Todo, store: Store) -> dict[str, float]:
    """Tell the user what the run will take, on standard error, and refuse it where the disk is too small.

    While images are still to be made, what comes after them may be stored: the disk must then have room for them alone.

    Returns:
        Seconds of each stage.

    Raises:
        InputError: what will be written does not fit on the disk.
    """
    found = estimate(config, sizes, todo)
    say(found.text(stored=not todo.make))
    check_room(found.lines[0].disk if 0 < todo.make < sizes.images else found.disk, store)
    warn_of_memory(found)
    return {line.stage: line.seconds for line in found.lines}


def check_room(needed: float, store: Store) -> None:
    """Raise InputError if what will be written, bytes, does not fit on the disk."""
    there = next(path for path in (store.root.absolute(), *store.root.absolute().parents) if path.exists())
    free = shutil.disk_usage(there).free
    if needed > free:
        raise InputError(
            f"store={store.root}: this run writes about {readable(needed)}, {readable(free)} are free; "
            "free some or choose another disk with store=DIR"
        )


def warn_of_memory(found: Estimate) -> None:
    """Say in one line that the machine has less memory than the run may need."""
    if "SC_PHYS_PAGES" not in os.sysconf_names:
        return
    have = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    if found.memory > have:
        log.warning(
            "this run may need %s of memory, the machine has %s: fewer queries, rows or workers need less",
            readable(found.memory),
            readable(have),
        )


def _task() -> float:
    """Return how long this core takes for a fixed task, seconds of its own time: the least of five."""
    image = np.random.default_rng(0).random((1024, 1024), dtype=np.float32)
    times = []
    for _ in range(5):
        begin = time.thread_time()
        cv2.GaussianBlur(image, (0, 0), 6)
        times.append(time.thread_time() - begin)
    return min(times)


def _span(seconds: float) -> str:
    """Return a length of time for people."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60:02d} min"
