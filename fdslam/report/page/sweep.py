"""The page of a sweep: its short table, each line with the way to its job's page, and its figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from urllib.parse import quote

import matplotlib as mpl
from matplotlib.figure import Figure

from fdslam.report.page.render import render
from fdslam.report.page.svg import STYLE, inline
from fdslam.report.tables import Grid
from fdslam.store import write_atomically


def write_sweep_page(
    folder: Path, grid: Grid, jobs: Sequence[str], figures: Callable[[], Mapping[str, Figure]]
) -> None:
    """Write ``sweep.html``.

    Args:
        folder: of the sweep, with one folder a job.
        grid: head and lines of the short table.
        jobs: of each line, its job's folder.
        figures: draws them, by the key that each is over.
    """
    with mpl.rc_context(STYLE):
        drawn = {key: inline(figure, said(key, grid)) for key, figure in figures().items()}
    there = {job for job in jobs if (folder / job / "report.html").is_file()}
    failed = {path.parent.name: path.read_text(encoding="utf-8").strip() for path in sorted(folder.glob("*/error.txt"))}
    page = render(
        "sweep.html.j2",
        ("page.js",),
        title=f"Sweep {folder.resolve().name}",
        grid=grid,
        jobs=jobs,
        links={job: f"{quote(job)}/report.html" for job in there},
        figures=drawn,
        failed=failed,
    )
    write_atomically(folder / "sweep.html", page)


def said(key: str, grid: Grid) -> str:
    """Return what a figure shows, for those who do not see it."""
    if key == "X":
        return (
            "Changed objects found over X, a panel for each method and a line for each job; the table has the values."
        )
    return (
        f"Accuracy, lc-AUROC and localisation recall over {key}; the table has the values of its {len(grid) - 1} lines."
    )
