"""How far a run was from its estimate: python -m experiments.speed.estimated FOLDER…, the folders of runs.

A run that found things stored is held against an estimate without them. Times mean something only where nothing else
ran on the machine.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path


def rows(folder: Path) -> list[tuple[str, float, float]]:
    """Return of every stage in a run's ``run.json`` the seconds that were estimated, and those it took."""
    found = json.loads((folder / "run.json").read_text())
    expected, took = found["estimated_seconds"], found["seconds"]
    stages = [(stage, expected.get(stage, 0.0), took[stage]) for stage in took]
    return [*stages, ("all", sum(expected.values()), sum(took.values()))]


def main() -> None:
    """Print a table for every folder."""
    for folder in map(Path, sys.argv[1:]):
        print(f"{folder}\n\n| stage | estimated, s | took, s | took / estimated |\n|---|---:|---:|---:|")
        for stage, expected, took in rows(folder):
            ratio = f"{took / expected:.2f}" if expected else "–"
            print(f"| {stage} | {expected:.0f} | {took:.0f} | {ratio} |")
        print()


if __name__ == "__main__":
    main()
