"""What is noted down of a finished run, read from its folder: the same for every tracker.

A name is a tuple of parts, such as ``("FD+AD", "all", "top-5")``; each tracker writes it as its readers want it.
"""

from __future__ import annotations

import csv
import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Name = tuple[str, ...]
PICTURE = ".png"
LEFT_OUT = "error.txt"  # of an attempt before


@dataclass(frozen=True)
class Record:
    """A finished run."""

    name: str  # of the runs, as the configuration says
    label: str  # of this one: its folder's name or, of a job, those of the sweep and of the job
    identity: str  # hex, of this run in this folder
    parameters: dict[str, str]  # the configuration, flat; without the tracker's own
    figures: dict[Name, float]  # the table with its intervals, recall, seconds and memory; undefined ones left out
    curves: dict[Name, list[tuple[int, float]]]  # step and loss of the autoencoders
    pictures: tuple[Path, ...]  # PNG files
    files: tuple[Path, ...]  # whatever else lies in the folder itself
    text: str  # table.md


def read_record(folder: Path, label: str) -> Record:
    """Return what is noted down of the run in a folder.

    Args:
        folder: of a run that is finished.
        label: of the run.

    Raises:
        OSError: a file cannot be read.
    """
    said = (folder / "run.json").read_bytes()
    run = json.loads(said)
    table = json.loads((folder / "table.json").read_text(encoding="utf-8"))
    figures: dict[Name, float] = {("peak memory MiB",): run["peak_memory_mib"]}
    figures |= {("seconds", stage): seconds for stage, seconds in run["seconds"].items()}
    for name, entry in table["localization"].items():
        figures |= _interval(("localisation", name), entry)
    for line in _lines(folder / "table.csv"):
        figures |= _interval((line["method"], line["pool"], line["figure"]), line)
    files = sorted(path for path in folder.iterdir() if path.is_file() and path.name != LEFT_OUT)
    return Record(
        run["config"]["name"],
        label,
        hashlib.sha256(said + str(folder.resolve()).encode()).hexdigest(),
        {key: value for key, value in _flat(run["config"]) if not key.startswith("tracker.")},
        figures,
        _curves(folder / "training.csv"),
        (*(path for path in files if path.suffix == PICTURE), *sorted((folder / "pictures").glob(f"*{PICTURE}"))),
        tuple(path for path in files if path.suffix != PICTURE),
        (folder / "table.md").read_text(encoding="utf-8"),
    )


def _lines(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _interval(name: Name, entry: dict[str, Any]) -> dict[Name, float]:
    """Return a figure and the ends of its interval under names of their own, as far as they are defined."""
    named = {"value": name, "low": (*name[:-1], f"{name[-1]} low"), "high": (*name[:-1], f"{name[-1]} high")}
    return {named[end]: float(entry[end]) for end in named if entry[end] not in ("", None)}


def _flat(config: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    for key, value in config.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", str(value)


def _curves(path: Path) -> dict[Name, list[tuple[int, float]]]:
    found: dict[Name, list[tuple[int, float]]] = {}
    for line in _lines(path) if path.is_file() else ():
        kind = {"training": "L1 of each epoch", "held-out": "held-out L1 of each fold"}[line["figure"]]
        name = ("training", line["map"], f"place {line['place']}", kind)
        found.setdefault(name, []).append((int(line["step"]), float(line["L1"])))
    return found
