"""Accuracy over X and over Y as a figure."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from io import BytesIO

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fdslam.config import Config
from fdslam.pipeline import Outcome

# Okabe and Ito's colours: told apart by the colour-blind too.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
CONTROL_STYLES = (":", "--", "-.", (0, (6, 2, 1, 2, 1, 2)))


def _style(i: int, methods: int) -> dict:
    """Return how the i-th row is drawn: methods in colour, controls grey."""
    if i < methods:
        again = "--" if i >= len(COLOURS) else "-"
        return {"color": COLOURS[i % len(COLOURS)], "linewidth": 1.8, "linestyle": again}
    return {"color": "0.45", "linewidth": 1.2, "linestyle": CONTROL_STYLES[(i - methods) % len(CONTROL_STYLES)]}


def _over_x(outcome: Outcome, config: Config, axes: Axes) -> None:
    methods = len(config.mix.rows)
    for i, row in enumerate(outcome.rows):
        if row.found_at is not None and len(row.found_at):
            at = np.sort(row.found_at)
            found = 100 * np.arange(1, len(at) + 1) / len(at)
            axes.step(
                np.r_[0, at, 100], np.r_[0, found, found[-1]], where="post", label=row.method, **_style(i, methods)
            )
    axes.set(xlim=(0, 50), ylim=(0, 100), xlabel="X, % of the cells", ylabel="changed objects found, %")
    axes.set_title("over X, all cells pooled", fontsize=9)
    axes.grid(alpha=0.3)


def _over_y(outcome: Outcome, config: Config, axes: Axes) -> None:
    percent, methods = max(config.evaluation.X), len(config.mix.rows)
    counts = sorted(outcome.over_Y)
    for i, row in enumerate(outcome.rows[:methods]):
        figures = [next(r.pooled[percent] for r in outcome.over_Y[y] if r.method == row.method) for y in counts]
        values = [np.nan if figure is None else figure.value for figure in figures]
        axes.plot(counts, values, marker="o", markersize=3.5, label=row.method, **_style(i, methods))
    axes.set(xlabel="Y, hypotheses", ylim=(0, None), xticks=counts)
    axes.set_title(f"over Y, X = {percent} %, all cells pooled", fontsize=9)
    axes.grid(alpha=0.3)


def panels(outcome: Outcome, config: Config) -> dict[str, Callable[[Axes], None]]:
    """Return what there is to draw, each part on axes of its own: over X and, where asked for, over Y."""
    if not any(row.found_at is not None and len(row.found_at) for row in outcome.rows):
        return {}
    found: dict[str, Callable[[Axes], None]] = {"over X": partial(_over_x, outcome, config)}
    if outcome.over_Y:
        found["over Y"] = partial(_over_y, outcome, config)
    return found


def draw_curves(outcome: Outcome, config: Config) -> bytes | None:
    """Return the figure as PNG: every X and, where ``evaluation.curve_Y`` asks for it, Y. None: nothing to draw."""
    parts = panels(outcome, config)
    if not parts:
        return None
    with mpl.rc_context({"font.family": "DejaVu Sans", "font.size": 8}):
        figure = Figure(figsize=(4.6 * len(parts) + 0.4, 3.8), dpi=120, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(1, len(parts), squeeze=False)[0]
        for each, draw in zip(axes, parts.values(), strict=True):
            draw(each)
        axes[0].legend(fontsize=7)
        png = BytesIO()
        figure.savefig(png, format="png")
    return png.getvalue()
