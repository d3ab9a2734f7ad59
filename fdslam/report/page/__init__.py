"""The report as one page that opens from disk: tables, curves, the queries, and why each is held for changed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fdslam.boxes import Candidate
from fdslam.config import Config
from fdslam.modes import deviations
from fdslam.pipeline import Outcome
from fdslam.report.page import figures, tables
from fdslam.report.page.gallery import gallery
from fdslam.report.page.render import render
from fdslam.report.tables import summary
from fdslam.store import write_atomically

PHOTOS = 3  # lines about them: how many, with what, and what the map keeps
SCRIPTS = ("page.js", "overlays.js", "gallery.js", "why.js")


def write_page(
    outcome: Outcome,
    config: Config,
    path: Path,
    run: dict[str, Any],
    title: str = "",
    candidates: Sequence[Sequence[Candidate]] | None = None,
) -> None:
    """Write the page of a run, at most ``report.megabytes`` large: all images are in it, and it asks for nothing else.

    Args:
        outcome: of the run; it need not be annotated.
        config: of the run.
        path: of the file.
        run: what ``run.json`` holds.
        title: above it; the data set and the methods if not said.
        candidates: per query boxes of what may have changed, where they are known.

    Raises:
        InputError: an image of the data set cannot be read any more.
    """
    folded = ("config", "seconds", "estimated_seconds", "peak_memory_mib", "command")
    values: dict[str, Any] = {
        "title": title or f"{outcome.dataset.name}: {', '.join(config.mix.rows)}",
        # Whose boxes are candidates are photos: that they have no truth goes without saying.
        "summary": summary(outcome, config)[: PHOTOS if candidates is not None else None],
        "accuracy": tables.accuracy(outcome, config),
        "methods": len(config.mix.rows),
        "further": tables.further(outcome, config),
        "curves": figures.curves(outcome, config),
        "recall": tables.recall(outcome),
        "recall_figure": figures.recall(outcome),
        "stages": tables.stages(run),
        "times": figures.times(run),
        "memory": run.get("peak_memory_mib"),
        "config": run.get("config", {}),
        "deviations": deviations(config),
        "command": run.get("command", []),
        "provenance": {key: value for key, value in run.items() if key not in folded},
        "megabytes": config.report.megabytes,
    }
    nothing = {"all": 0, "queries": [], "images": {}, "annotated": False, "methods": [], "percents": []}
    rest = len(render("run.html.j2", SCRIPTS, gallery=nothing, **values)) + 4096  # and what is said of their number
    shown = gallery(outcome, config, round(1e6 * config.report.megabytes) - rest, candidates)
    write_atomically(path, render("run.html.j2", SCRIPTS, gallery=shown, **values))
