"""The figures of a run's page, each with its words for those who do not see it."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes

from fdslam.config import Config
from fdslam.metrics import Figure
from fdslam.pipeline import Outcome
from fdslam.report.curves import COLOURS, panels
from fdslam.report.page.svg import panel


def curves(outcome: Outcome, config: Config) -> list[Markup]:
    """Return the curves over X and Y, as far as there are any."""
    said = {"over X": _said_over_x(outcome), "over Y": _said_over_y(outcome, config)}
    return [
        panel(draw, f"Changed objects found {name}. {said[name]}") for name, draw in panels(outcome, config).items()
    ]


def _percent(figure: Figure | None) -> str:
    return "undefined" if figure is None else f"{figure.value:.1f} %"


def _said_over_x(outcome: Outcome) -> str:
    lines = (
        f"{row.method}: " + ", ".join(f"{_percent(figure)} at X = {x} %" for x, figure in row.pooled.items())
        for row in outcome.rows
    )
    return "; ".join(lines) + "."


def _said_over_y(outcome: Outcome, config: Config) -> str:
    percent = max(config.evaluation.X)
    lines = (
        f"Y = {y}: " + ", ".join(f"{row.method} {_percent(row.pooled[percent])}" for row in rows)
        for y, rows in sorted(outcome.over_Y.items())
    )
    return f"At X = {percent} %, " + "; ".join(lines) + "."


def recall(outcome: Outcome) -> Markup | None:
    """Return localisation recall over the length of the strong list with its intervals; None where it is unknown."""
    known = {n: figure for n, figure in sorted(outcome.recall.items()) if figure is not None}
    if not known:
        return None
    said = "Localisation recall. " + ", ".join(f"@{n}: {_percent(figure)}" for n, figure in known.items()) + "."
    return panel(partial(_recall, known), said, legend=False)


def _recall(known: dict[int, Figure], axes: Axes) -> None:
    at, value = list(known), np.array([figure.value for figure in known.values()])
    low, high = (np.array([getattr(figure, side) for figure in known.values()]) for side in ("low", "high"))
    axes.errorbar(at, value, yerr=np.maximum([value - low, high - value], 0), color=COLOURS[0], marker="o", capsize=3)
    axes.set(xlabel="n, first map images of the strong list", ylabel="queries with a true place among them, %")
    axes.set(xticks=at, ylim=(0, 102))
    axes.set_title("localisation recall@n", fontsize=9)
    axes.grid(alpha=0.3)


def times(run: dict[str, Any]) -> Markup | None:
    """Return the seconds of every stage beside what was estimated; None where nothing was timed."""
    seconds = run.get("seconds", {})
    if not seconds:
        return None
    said = "Seconds of the stages. " + ", ".join(f"{name}: {value:.1f}" for name, value in seconds.items()) + "."
    return panel(
        partial(_times, seconds, run.get("estimated_seconds", {})), said, legend=bool(run.get("estimated_seconds"))
    )


def _times(seconds: dict[str, float], estimated: dict[str, float], axes: Axes) -> None:
    names = list(seconds)
    axes.barh(range(len(names)), list(seconds.values()), height=0.5, color=COLOURS[0], label="as it was")
    there = [i for i, name in enumerate(names) if name in estimated]
    expected = [estimated[names[i]] for i in there]
    axes.plot(expected, there, linestyle="none", marker="D", color=COLOURS[1], markersize=5, label="as estimated")
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set(xlabel="seconds", xlim=(0, None))
    axes.set_title("time of the stages", fontsize=9)
    axes.grid(axis="x", alpha=0.3)
