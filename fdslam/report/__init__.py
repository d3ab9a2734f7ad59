"""What a run leaves behind: tables for people and programs, provenance and pictures."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from fdslam.config import Config
from fdslam.pipeline import Outcome
from fdslam.progress import worker_count
from fdslam.provenance import Stopwatch, provenance
from fdslam.report.curves import draw_curves
from fdslam.report.data import pairs_csv, table_csv, table_json, training_csv
from fdslam.report.latex import table_latex
from fdslam.report.page import write_page
from fdslam.report.pictures import draw_pictures
from fdslam.report.tables import table_markdown, table_text
from fdslam.store import write_atomically


def write_report(
    outcome: Outcome, config: Config, folder: Path, watch: Stopwatch, made_of: dict[str, Any] | None = None
) -> str:
    """Write the table in every form, curves, pictures, the page and, last, ``run.json``; return the table as text.

    Args:
        outcome: of the run.
        config: of the run.
        folder: to write to.
        watch: of the run.
        made_of: ``fdslam.finished.signature`` before the run; without it no sweep takes the run for one of its jobs.
    """
    with watch.stage("pictures"):
        draw_pictures(outcome, config, folder / "pictures")
    seconds = sum(watch.seconds.values())
    table = table_json(outcome, config, seconds)
    write_atomically(folder / "table.json", _json(table))
    write_atomically(folder / "table.csv", table_csv(outcome).encode())
    write_atomically(folder / "table.md", table_markdown(outcome, config).encode())
    write_atomically(folder / "table.tex", table_latex(outcome, config).encode())
    if outcome.pairs:
        write_atomically(folder / "pairs.csv", pairs_csv(outcome).encode())
    (folder / "training.csv").unlink(missing_ok=True)  # of an earlier run into the same folder, as the page below
    if outcome.training:
        write_atomically(folder / "training.csv", training_csv(outcome).encode())
    if curves := draw_curves(outcome, config):
        write_atomically(folder / "curves.png", curves)
    (folder / "report.html").unlink(missing_ok=True)  # of an earlier run into the same folder
    if config.report.page:
        run = (made_of or {}) | provenance(asdict(config), watch, worker_count(config.workers))
        with watch.stage("pictures"):
            write_page(outcome, config, folder / "report.html", run)
    run = (made_of or {}) | provenance(asdict(config), watch, worker_count(config.workers))
    write_atomically(folder / "run.json", _json(run))
    return table_text(outcome, config)


def _json(value: Any) -> bytes:
    return (json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()
