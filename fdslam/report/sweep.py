"""What the jobs of a sweep found, in one long table, one short one, and figures."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from fdslam.errors import InputError
from fdslam.finished import NO_PART_OF_A_RESULT
from fdslam.report.page.sweep import write_sweep_page
from fdslam.report.sweep_figures import draw, figures
from fdslam.report.tables import NOTHING, aligned, markdown
from fdslam.store import write_atomically

AREAS = {"auroc": "AUROC", "lc_auroc": "lc-AUROC", "ap": "AP", "f1_max": "F1-max"}  # as table.json and table.csv say
LOCALIZATION = "localisation"  # stands in the place of a method
NOT_SWEPT = {*NO_PART_OF_A_RESULT, "name"}


@dataclass(frozen=True)
class Job:
    """One finished job."""

    name: str  # of its folder
    settings: dict[str, Any]  # the keys in which the jobs differ; a list is written as one text
    table: dict[str, Any]  # its table.json
    methods: tuple[str, ...]  # rows of its table that are no controls

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Those rows."""
        return [row for row in self.table["rows"] if row["method"] in self.methods]


def read_jobs(folder: Path) -> list[Job]:
    """Return the finished jobs of a sweep, by number.

    Raises:
        InputError: there is none.
    """
    found = []
    for path in folder.glob("*/run.json"):
        try:
            config = json.loads(path.read_text(encoding="utf-8"))["config"]
            table = json.loads((path.parent / "table.json").read_text(encoding="utf-8"))
        except (OSError, ValueError, KeyError) as error:
            raise InputError(f"{path.parent}: not a whole run folder ({error}); remove it and run again") from error
        found.append((path.parent.name, dict(_flat(config)), table, tuple(config["mix"]["rows"])))
    if not found:
        raise InputError(f"{folder}: no job has finished, so there is nothing to gather")
    found.sort(key=lambda job: (len(job[0]), job[0]))
    keys = [key for key in dict.fromkeys(key for job in found for key in job[1]) if _differs(key, found)]
    return [Job(name, {key: flat.get(key) for key in keys}, table, rows) for name, flat, table, rows in found]


def _flat(config: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in config.items():
        if f"{prefix}{key}" in NOT_SWEPT:
            continue
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", ", ".join(map(str, value)) if isinstance(value, list) else value


def _differs(key: str, jobs: Sequence[tuple[str, dict[str, Any], dict[str, Any], tuple[str, ...]]]) -> bool:
    return len({json.dumps(job[1].get(key)) for job in jobs}) > 1


def _figures(table: dict[str, Any]) -> Iterator[tuple[str, str, str, str, dict[str, float | None]]]:
    """Yield pair, method, pool, figure and value with its interval, of a whole table and of each of its pairs."""
    for part in (table, *table["pairs"]):
        pair = f"{part['query_session']}/{part['map_session']}" if "query_session" in part else ""
        for figure, entry in part["localization"].items():
            yield pair, LOCALIZATION, "", figure, entry
        for row in part["rows"]:
            for name, pool in (("pooled", "all"), ("per_query", "query")):
                for x, entry in row[name].items():
                    yield pair, row["method"], pool, f"top-{x}", entry
            for name, shown in AREAS.items():
                yield pair, row["method"], "all", shown, row[name]


def long_table(jobs: Sequence[Job]) -> pa.Table:
    """Return one line per job, pair of sessions, method, pool and figure.

    Columns: job, the keys in which the jobs differ, dataset, pair (empty: all queries together), method, pool, figure,
    value, low, high (null where undefined).
    """
    lines = [
        {
            "job": job.name,
            **job.settings,
            "dataset": job.table["dataset"],
            "pair": pair,
            "method": method,
            "pool": pool,
            "figure": figure,
            **entry,
        }
        for job in jobs
        for pair, method, pool, figure, entry in _figures(job.table)
    ]
    # A key may be a number in one job and text in another (auto, 640): then all of its column is text.
    for key in jobs[0].settings:
        kinds = {type(line[key]) for line in lines} - {type(None)}
        if len(kinds) > 1 and not kinds <= {int, float}:
            for line in lines:
                line[key] = None if line[key] is None else str(line[key])
        elif kinds == {int, float}:
            for line in lines:
                line[key] = None if line[key] is None else float(line[key])
    return pa.Table.from_pylist(lines)


def short_table(jobs: Sequence[Job]) -> list[list[str]]:
    """Return head and one line per job and method: settings, accuracy, areas, recall; of all queries together."""
    percents = list(dict.fromkeys(x for job in jobs for row in job.table["rows"] for x in row["pooled"]))
    recalls = list(dict.fromkeys(figure for job in jobs for figure in job.table["localization"]))
    several = len({job.table["dataset"] for job in jobs}) > 1
    data = ["data"] if several else []
    head = [*jobs[0].settings, *data, "method", *(f"X = {x} %" for x in percents), "lc-AUROC", *recalls]
    lines = [head]
    for job in jobs:
        start = [str(value) for value in job.settings.values()] + ([job.table["dataset"]] if several else [])
        recall = [_shown(job.table["localization"].get(figure)) for figure in recalls]
        for row in job.rows:
            accuracy = [_shown(row["pooled"].get(x)) for x in percents]
            lines.append([*start, row["method"], *accuracy, _shown(row["lc_auroc"], 3), *recall])
        if not job.rows:
            lines.append([*start, NOTHING, *([NOTHING] * (len(percents) + 1)), *recall])
    return lines


def _shown(entry: dict[str, float | None] | None, digits: int = 1) -> str:
    if entry is None or entry["value"] is None:
        return NOTHING
    return f"{entry['value']:.{digits}f}"


def write_sweep(folder: Path) -> str:
    """Write the sweep as Parquet, CSV, Markdown, a page and a figure per key that was swept; return the short table.

    Args:
        folder: of the sweep, with one folder a job.

    Raises:
        InputError: no job has finished, a job's folder is damaged, or the disk is full.
    """
    jobs = read_jobs(folder)
    table, short = long_table(jobs), short_table(jobs)
    parquet, text = BytesIO(), BytesIO()
    pyarrow.parquet.write_table(table, parquet)
    pyarrow.csv.write_csv(table, text)
    write_atomically(folder / "sweep.parquet", parquet.getvalue())
    write_atomically(folder / "sweep.csv", text.getvalue())
    write_atomically(folder / "sweep.md", ("\n".join(markdown(short)) + "\n").encode())
    methods = list(dict.fromkeys(method for job in jobs for method in job.methods))
    keys = list(jobs[0].settings)
    for name, png in draw(table, keys, methods).items():
        write_atomically(folder / name, png)
    told = [job.name for job in jobs for _ in range(max(1, len(job.rows)))]
    write_sweep_page(folder, short, told, partial(figures, table, keys, methods))
    return "\n".join(aligned(short, (0,)))
