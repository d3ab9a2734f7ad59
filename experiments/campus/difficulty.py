"""How hard it is to localise each session in each other: python -m experiments.campus.difficulty [--store DIR]

Recall@1 of the strong list (J+B, everything else as by default) per ordered pair, and what the pair's queries hold.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from fdslam.config import Bow, Campus, Obb
from fdslam.data import load_datasets
from fdslam.data.campus import SESSIONS
from fdslam.mapping import BowMap
from fdslam.obb import Library
from fdslam.progress import single_threaded
from fdslam.store import Store
from fdslam.types import Dataset


def recall(data: Dataset, store: Store, workers: int) -> float:
    """Return recall@1 in percent."""
    _, found = BowMap(data.map, Bow(), Library(Obb("J+B")), store, workers).localize(data.query)
    assert data.relevant is not None
    return 100 * float(np.mean([one.strong[0] in true for one, true in zip(found, data.relevant, strict=True)]))


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--store", type=Path, default=Path("outputs/store"), help="where the campus is rendered")
    parser.add_argument("--images", type=int, default=Campus().images, help="of the four sessions together")
    parser.add_argument("--workers", type=int, default=0)
    given = parser.parse_args()
    single_threaded()
    store = Store(given.store)
    sets = load_datasets(Campus(query="all", map="all", images=given.images), store, given.workers)
    hit = {data.pair: recall(data, store, given.workers) for data in sets}
    print("| query \\ map | " + " | ".join(SESSIONS) + " |\n|---|" + "---:|" * len(SESSIONS))
    for query in SESSIONS:
        cells = [f"{hit[query, map_]:.1f}" if map_ != query else "–" for map_ in SESSIONS]
        print(f"| {query} | " + " | ".join(cells) + " |", flush=True)
    print("\n| query, map | queries | with change | annotated objects |\n|---|---:|---:|---:|")
    for data in sets:
        assert data.boxes is not None
        counts = [len(boxes) for boxes in data.boxes]
        print(f"| {', '.join(data.pair or ())} | {len(counts)} | {np.count_nonzero(counts)} | {sum(counts)} |")


if __name__ == "__main__":
    main()
