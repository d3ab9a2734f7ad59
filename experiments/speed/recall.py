"""What the faster word search costs in localisation: python -m experiments.speed.recall [FOLDER ...]

Recall@1/5/10 of the strong list (J+B), the word search exact and as by default, on every folder given (as
dataset=folder wants it) or, with none, on all pairs of sessions of the campus. The last column: keypoints that both
know or both do not know.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from fdslam.config import Bow, Campus, Folder, Obb
from fdslam.data import load_datasets
from fdslam.data.folder import read_folder
from fdslam.mapping import BowMap
from fdslam.obb import Library
from fdslam.progress import single_threaded
from fdslam.store import Store
from fdslam.types import Dataset

AT = (1, 5, 10)
EVERY_WORD = 1 << 30


def localized(data: Dataset, config: Bow, store: Store) -> tuple[list[list[bool]], list[np.ndarray]]:
    """Return per query whether its place is in the first n of AT, and its words."""
    bow = BowMap(data.map, config, Library(Obb("J+B")), store, 0)
    _, found = bow.localize(data.query)
    assert data.relevant is not None
    hits = [[np.isin(one.strong[:n], true).any() for n in AT] for one, true in zip(found, data.relevant, strict=True)]
    return hits, [bow.words(frame) for frame in data.query]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", nargs="*", type=Path)
    folders = parser.parse_args().folders
    single_threaded()
    print(
        "| data set | queries | exact: recall@1 / 5 / 10 | by default | known in both or neither |\n"
        "|---|---:|---|---|---:|",
        flush=True,
    )
    with tempfile.TemporaryDirectory() as root:
        store = Store(root)
        sets = [(read_folder(folder, Folder()),) for folder in folders] or [
            load_datasets(Campus(all_pairs=True), store, 0)
        ]
        for pairs in sets:
            exact, lists, same = [], [], []
            for data in pairs:
                hits, words = localized(data, replace(Bow(), exact_below=EVERY_WORD), store)
                others_hits, others = localized(data, Bow(), store)
                exact += hits
                lists += others_hits
                # Ids differ once the vocabularies do: a keypoint counts where both know it or both do not.
                same += [np.mean((a >= 0) == (b >= 0)) for a, b in zip(words, others, strict=True)]
            shown = [" / ".join(f"{x:.1f}" for x in 100 * np.mean(each, axis=0)) for each in (exact, lists)]
            print(f"| {pairs[0].name} | {len(exact)} | {shown[0]} | {shown[1]} | {np.mean(same):.3f} |", flush=True)


if __name__ == "__main__":
    main()
