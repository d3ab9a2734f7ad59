"""What each refinement does to localisation and to FD: python -m experiments.refinement.effects [FOLDER ...]

One row for each switch, alone, on every folder given (as dataset=folder wants it) or, with none, on the campus: OBBs
J+B, FD alone, everything else as it is by default.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

from fdslam.config import Bow, Campus, Config, Folder, Mix, Obb
from fdslam.metrics import Figure
from fdslam.pipeline import Outcome, run
from fdslam.progress import single_threaded
from fdslam.provenance import Stopwatch

SWITCHES: dict[str, dict[str, Any]] = {
    "none": {},
    "islands=ibow": {"islands": "ibow"},
    "islands=dloop": {"islands": "dloop"},
    "purge=true": {"purge": True},
    "second=other_place": {"second": "other_place"},
    "document=obb": {"document": "obb"},
    "verify_top=5": {"verify_top": 5},
    "verify_top=10": {"verify_top": 10},
}


def _percent(figures: dict[int, Figure]) -> str:
    return " / ".join(f"{figure.value:.1f}" for figure in figures.values())


def line(switch: str, outcome: Outcome) -> str:
    """Return one row of Markdown."""
    fd = next(row for row in outcome.rows if row.method == "FD")
    recall = {n: figure for n, figure in outcome.recall.items() if figure is not None}
    area = f"{fd.lc_auroc.value:.3f} ({fd.lc_auroc.low:.3f}–{fd.lc_auroc.high:.3f})"
    kept = f"{outcome.kept['bag of words'] / 1000:.0f}"
    return f"| {outcome.dataset.name} | {switch} | {kept} | {_percent(recall)} | {_percent(fd.pooled)} | {area} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", nargs="*", type=Path)
    folders = parser.parse_args().folders
    single_threaded()
    print(
        "| data set | switch | KB / image | recall@1 / 5 / 10 | FD | lc-AUROC |\n|---|---|---:|---|---|---|", flush=True
    )
    for data in [Folder(root=str(folder)) for folder in folders] or [Campus()]:
        for switch, changes in SWITCHES.items():
            bow = replace(Bow(), **changes)
            config = Config(name="effects", dataset=data, obb=Obb("J+B"), bow=bow, mix=Mix(rows=["FD"]))
            print(line(switch, run(config, Stopwatch())), flush=True)


if __name__ == "__main__":
    main()
