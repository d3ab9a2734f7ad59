"""The figures of a sweep: accuracy over X, and over each key that was swept."""

from __future__ import annotations

import re
from collections.abc import Sequence
from io import BytesIO
from typing import Any

import matplotlib as mpl
import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fdslam.report.curves import COLOURS

MARKS = "osD^vP"
MOST_LINES = 12  # over X: more cannot be told apart
MOST_TICKS = 10
CONTROLLED = "lc-AUROC"  # chance is 0.5


def figures(table: pa.Table, keys: Sequence[str], methods: Sequence[str]) -> dict[str, Figure]:
    """Return a figure for each key and, by the name X, one over X where there are methods; not yet rendered.

    Args:
        table: the long table of ``fdslam.report.sweep``.
        keys: in which the jobs differ.
        methods: rows that are no controls.
    """
    whole = table.filter(pc.equal(table["pair"], ""))
    found = {key: _over_key(whole, key, methods or ["localisation"]) for key in keys}
    if methods:
        found["X"] = _over_x(whole, list(keys), methods)
    return found


def draw(table: pa.Table, keys: Sequence[str], methods: Sequence[str]) -> dict[str, bytes]:
    """Return the figures as PNG by the names of their files; arguments as ``figures``."""
    with mpl.rc_context({"font.family": "DejaVu Sans", "font.size": 8, "text.parse_math": False}):
        found = figures(table, keys, methods)
        return {f"over_{re.sub(r'[^A-Za-z0-9]+', '_', key)}.png": _png(figure) for key, figure in found.items()}


def _png(figure: Figure) -> bytes:
    png = BytesIO()
    figure.savefig(png, format="png")
    return png.getvalue()


def _panels(count: int, height: float) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(4.2 * count + 0.6, height), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, list(figure.subplots(1, count, squeeze=False)[0])


def _largest(table: pa.Table) -> str:
    """Return the figure of the largest X."""
    tops = [name for name in pc.unique(table["figure"]).to_pylist() if name.startswith("top-")]
    return max(tops, key=lambda name: int(name.removeprefix("top-")), default="")


def _of(table: pa.Table, method: str, pool: str, figure: str) -> pa.Table:
    wanted = pc.and_(pc.equal(table["method"], method), pc.equal(table["figure"], figure))
    return table.filter(pc.and_(wanted, pc.equal(table["pool"], pool))).filter(pc.field("value").is_valid())


def _over_key(table: pa.Table, key: str, methods: Sequence[str]) -> Figure:
    """Return a figure with accuracy, lc-AUROC and recall over the values of a key."""
    top = _largest(table)
    recalls = [name for name in pc.unique(table["figure"]).to_pylist() if name.startswith("recall@")]
    wanted = [
        (f"found at X = {top.removeprefix('top-')} %, % of the objects", [(m, "all", top, m) for m in methods]),
        (CONTROLLED, [(m, "all", CONTROLLED, m) for m in methods]),
        ("localisation recall, %", [("localisation", "", name, name) for name in recalls]),
    ]
    table = table.filter(pc.field(key).is_valid())  # of data sets and options, some have keys that others lack
    found = [(title, [(_of(table, *one[:3]), one[3]) for one in parts]) for title, parts in wanted]
    panels = [(title, kept) for title, parts in found if (kept := [one for one in parts if len(one[0])])]
    values = [value for value in pc.unique(table[key]).to_pylist() if value is not None]
    numbers = all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
    figure, axes = _panels(max(1, len(panels)), 3.6 if numbers else 1.2 + 0.26 * len(values))
    for n, (each, (title, parts)) in enumerate(zip(axes, panels, strict=False)):
        if numbers:
            _along_numbers(each, parts, key, sorted(values))
        else:
            _beside_names(each, parts, key, values, named=n == 0)
        if title == CONTROLLED:
            (each.axhline if numbers else each.axvline)(0.5, color="0.5", linewidth=0.8, linestyle=":")
        each.set_title(title, fontsize=9)
        each.grid(alpha=0.3)
        each.legend(fontsize=7)
    return figure


def _style(i: int) -> dict[str, Any]:
    return {"color": COLOURS[i % len(COLOURS)], "marker": MARKS[i % len(MARKS)], "markersize": 4}


def _along_numbers(axes: Axes, parts: list[tuple[pa.Table, str]], key: str, values: list[float]) -> None:
    """Draw the mean of the jobs of each value as a line and, where there are several, each job as a mark."""
    for i, (part, label) in enumerate(parts):
        at, value = np.array(part[key].to_pylist()), np.array(part["value"].to_pylist())
        there = [one for one in values if one in at]
        axes.plot(there, [value[at == one].mean() for one in there], label=label, **_style(i))
        if len(value) > len(there):
            axes.plot(at, value, linestyle="none", alpha=0.4, **_style(i))
    axes.set(xlabel=key, xticks=values if len(values) <= MOST_TICKS else axes.get_xticks())


def _beside_names(axes: Axes, parts: list[tuple[pa.Table, str]], key: str, values: list[Any], named: bool) -> None:
    """Draw each job as a mark with its interval, a line of the figure for each value."""
    for i, (part, label) in enumerate(parts):
        places = [values.index(one) + 0.16 * (i - (len(parts) - 1) / 2) for one in part[key].to_pylist()]
        value, low, high = (np.array(part[column].to_pylist()) for column in ("value", "low", "high"))
        span = np.maximum([value - low, high - value], 0)
        axes.errorbar(value, places, xerr=span, fmt="none", elinewidth=0.8, ecolor=_style(i)["color"])
        axes.plot(value, places, linestyle="none", label=label, **_style(i))
    axes.set_yticks(range(len(values)), [str(one) for one in values] if named else [])
    axes.set_ylim(len(values) - 0.5, -0.5)


def _over_x(table: pa.Table, keys: list[str], methods: Sequence[str]) -> Figure:
    """Return a figure with a panel per method: objects found over X, a line per job."""
    tops = [name for name in pc.unique(table["figure"]).to_pylist() if name.startswith("top-")]
    tops.sort(key=lambda name: int(name.removeprefix("top-")))
    jobs = pc.unique(table["job"]).to_pylist()
    colours = mpl.colormaps["viridis"](np.linspace(0, 0.92, len(jobs)))
    figure, axes = _panels(len(methods), 3.6)
    for each, method in zip(axes, methods, strict=True):
        for job, colour in zip(jobs, colours, strict=True):
            mine = table.filter(pc.equal(table["job"], job))
            points = [(int(t.removeprefix("top-")), _of(mine, method, "all", t)["value"].to_pylist()) for t in tops]
            points = [(x, value[0]) for x, value in points if value]
            if points:
                label = ", ".join(str(mine[key][0].as_py()) for key in keys)
                each.plot(*zip(*points, strict=True), color=colour, marker="o", markersize=3, label=label)
        each.set(xlabel="X, % of the cells", ylabel="changed objects found, %", ylim=(0, 100))
        each.set_title(method, fontsize=9)
        each.grid(alpha=0.3)
    if keys and len(jobs) <= MOST_LINES:
        axes[0].legend(fontsize=6, title=", ".join(keys), title_fontsize=6)
    return figure
