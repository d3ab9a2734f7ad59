"""Finished runs: a sweep does not repeat a job that was done before, by the same code on the same files.

A run folder is finished if it holds ``run.json``, which is written last. It says with which configuration, by what code
and from what files the run was made.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

from fdslam.config import Config
from fdslam.modes import CONF
from fdslam.provenance import versions
from fdslam.store import digest, sha256_file

NO_PART_OF_A_RESULT = ("store", "workers", "tracker")


@cache
def code() -> str:
    """Return the digest of the package: its source, its tables, and the configuration's files."""
    here = Path(__file__).parent
    sources = [*here.rglob("*.py"), *here.rglob("*.json"), *CONF.rglob("*.yaml")]
    return digest([[path.name, sha256_file(path)] for path in sorted(sources)])


def files(config: Config) -> str:
    """Return the digest of the data set's files: names, sizes and times, not contents."""
    root = Path(getattr(config.dataset, "root", "")).expanduser()
    places = [root] if getattr(config.dataset, "root", "") else []
    if annotations := getattr(config.dataset, "annotations", ""):
        # Some data sets look for them from here, some from their root.
        places += [Path(annotations).expanduser(), root / Path(annotations).expanduser()]
    told = []
    for path in sorted({each for place in places for each in _below(place)}):
        state = path.stat()
        told.append([str(path), state.st_size, state.st_mtime_ns])
    return digest(told)


def _below(place: Path) -> Iterator[Path]:
    """Yield the files of a folder and, through links as well, of those in it; or the file itself."""
    if place.is_file():
        yield place
    seen = set()
    for folder, folders, names in os.walk(place, followlinks=True):
        if (real := os.path.realpath(folder)) in seen:
            folders.clear()  # a link leads back
            continue
        seen.add(real)
        yield from (path for name in names if (path := Path(folder, name)).is_file())


def signature(config: Config, models: dict[str, Any]) -> dict[str, Any]:
    """Return what makes two runs the same, JSON-able: configuration, models, code, libraries and files.

    It is taken before a run: what changes while it works is not what it was made from.

    Args:
        config: of the run.
        models: what tells the OBB library and the segmentation from others.
    """
    kept = {key: value for key, value in asdict(config).items() if key not in NO_PART_OF_A_RESULT}
    return {"config": kept, "models": models, "code": code(), "versions": versions(), "files": files(config)}


def finished(wanted: dict[str, Any], folders: Iterable[Path]) -> Path | None:
    """Return the first of the folders that holds a finished run of a signature; None if there is none.

    Args:
        wanted: of ``signature``.
        folders: run folders; those without a readable ``run.json`` are passed over, as an unfinished run is.
    """
    wanted = json.loads(json.dumps(wanted))
    for folder in folders:
        try:
            found = json.loads((folder / "run.json").read_text(encoding="utf-8"))
            kept = {key: value for key, value in found["config"].items() if key not in NO_PART_OF_A_RESULT}
            if {**{key: found[key] for key in wanted}, "config": kept} == wanted:
                return folder
        except (OSError, ValueError, KeyError, AttributeError, TypeError):
            continue
    return None
