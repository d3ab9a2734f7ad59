"""What an update of a map takes, with and without learning again: python -m experiments.speed.update [DIR …]

A map of the first images of a folder or, without one, of the campus grows by the next ten, in mode best: once it keeps
what it learned, once it learns again from all. Nothing of these images is in a store.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from experiments.compact.prepared import configuration, options
from fdslam import ChangeDetector
from fdslam.data import load_datasets
from fdslam.progress import single_threaded
from fdslam.store import Store

NEW = 10  # images


def seconds(work: Callable[[], object]) -> float:
    """Return how long it took by the clock."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def lines(photos: list[Path], first: int, settings: list[str]) -> list[str]:
    """Return the rows of the table for a map of the ``first`` images that grows by the next."""
    new = photos[first : first + NEW]
    rows = []
    for name, learn in (("keeps what it learned", False), ("learns again", True)):
        detector = ChangeDetector("best", settings=settings)
        fit = seconds(lambda made=detector: made.fit(photos[:first]))
        update = seconds(lambda made=detector, again=learn: made.update(new, learn=again))
        rows.append(f"| {first} + {len(new)} | {name} | {fit:.1f} | {update:.1f} | {update / fit:.2f} |")
    return rows


def main() -> None:
    """Print the table."""
    parser = options(__doc__)
    parser.add_argument("--first", type=int, default=80, help="images that the map is fitted to")
    asked = parser.parse_args()
    single_threaded()
    settings = [f"obb.yolo.weights={asked.yolo}", f"obb.bing.filters={asked.bing}", "workers=1"]
    for folder in asked.folders or [None]:
        config = configuration(folder, asked.yolo, asked.bing, asked.store)
        data = load_datasets(config.dataset, Store(config.store), 1)[0]
        rows = lines([frame.path for frame in data.map], asked.first, settings)
        head = "| images | the map | fit, s | update, s | update / fit |\n|---|---|---:|---:|---:|"
        print("\n".join([f"{data.name}, {data.map[0].width} × {data.map[0].height}\n", head, *rows]), flush=True)


if __name__ == "__main__":
    main()
