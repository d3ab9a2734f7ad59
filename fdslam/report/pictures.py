"""One picture a query: what was seen, what was remembered, and where each method sees a change."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from io import BytesIO
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from fdslam.config import Config
from fdslam.data.images import read_image
from fdslam.fusion import percentiles
from fdslam.metrics import positive_cells
from fdslam.pipeline import Outcome
from fdslam.progress import progress
from fdslam.queries import Maps
from fdslam.store import write_atomically
from fdslam.types import CELL

PANEL, GAP, TITLE, BAR = 2.6, 0.08, 0.24, 0.5  # inches: longer side of a panel, between panels, above, colour bar
TRUTH, BOX = "#00e5ff", "#ffb000"  # safe for the colour-blind, visible on photographs


def score_queries(outcome: Outcome, percentile: Maps) -> list[float]:
    """Return per query by how much higher the changed cells stand than the rest, larger is better.

    Unchanged queries are judged by how low their highest hundredth stands; without annotations the list is empty.
    """
    if outcome.dataset.boxes is None:
        return []
    scores = []
    for frame, boxes, place in zip(outcome.dataset.query, outcome.dataset.boxes, percentile, strict=True):
        changed = positive_cells(boxes, frame.height, frame.width)
        if changed.any() and not changed.all():
            scores.append(float(place[changed].mean() - place[~changed].mean()))
        else:
            scores.append(0.5 - float(np.quantile(place, 0.99)))
    return scores


def rank_queries(outcome: Outcome, percentile: Maps) -> list[int]:
    """Return the queries from best to worst by ``score_queries``."""
    scores = score_queries(outcome, percentile)
    return sorted(range(len(scores)), key=lambda q: -scores[q])


def _show(axes: Axes, image: NDArray[np.uint8], title: str) -> None:
    axes.imshow(image, extent=(0, image.shape[1], image.shape[0], 0))
    axes.set_title(title, fontsize=7, parse_math=False)
    axes.set_axis_off()


def _outline(axes: Axes, boxes: NDArray[np.float32], colour: str, width: float) -> None:
    for x0, y0, x1, y1 in boxes:
        axes.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, edgecolor=colour, linewidth=width))


def _panels(count: int, aspect: float) -> tuple[Figure, list[Axes], Axes]:
    """Return a figure with ``count`` panels, in a row or two, and a narrow one for the colour bar.

    Their places are computed: matplotlib's layout engines take longer than the drawing.
    """
    width, height = PANEL * min(1, aspect), PANEL / max(1, aspect)
    rows = 2 if aspect > 1 and count > 4 else 1  # or wide images would be a ribbon
    columns = -(-count // rows)
    total, top = columns * (width + GAP) + BAR, rows * (height + TITLE)
    figure = Figure(figsize=(total, top), dpi=110)
    FigureCanvasAgg(figure)
    panels = []
    for i in range(count):
        row, column = divmod(i, columns)
        left, bottom = GAP / 2 + column * (width + GAP), top - (row + 1) * (height + TITLE) + 0.02
        panels.append(figure.add_axes((left / total, bottom / top, width / total, height / top)))
    right = columns * (width + GAP) + GAP / 2
    return figure, panels, figure.add_axes((right / total, 0.06, 0.1 / total, 0.88 - TITLE / top))


def draw_query(outcome: Outcome, heat: Mapping[str, NDArray[np.float32]], query: int) -> bytes:
    """Return the picture of one query as PNG: the query with truth and OBBs, the top map image, a heat map a method.

    Args:
        outcome: of the run.
        heat: per method the percentile of every cell of the query.
        query: which one.
    """
    data = outcome.dataset
    frame = data.query[query]
    image = read_image(frame.path)
    truth = data.boxes[query] if data.boxes is not None else np.zeros((0, 4), np.float32)
    count = 2 + len(heat)
    figure, axes, bar = _panels(count, frame.width / frame.height)
    changed = f": {len(truth)} changed" if data.boxes is not None else ""
    _show(axes[0], image, f"{frame.name}{changed}")
    _outline(axes[0], outcome.localizations[query].boxes.xyxy, BOX, 0.4)
    _outline(axes[0], truth, TRUTH, 1.4)
    hypotheses = outcome.hypotheses[query]
    if len(hypotheses):
        top = data.map[hypotheses[0]]
        known = data.relevant is not None
        right = known and hypotheses[0] in data.relevant[query]  # type: ignore[index]
        _show(
            axes[1],
            read_image(top.path),
            f"{top.name}" + (f" ({'right' if right else 'wrong'} place)" if known else ""),
        )
    else:
        axes[1].set_axis_off()
    for panel, (method, places) in zip(axes[2:], heat.items(), strict=True):
        _show(panel, np.repeat(image.mean(axis=2, keepdims=True), 3, axis=2).astype(np.uint8), method)
        rows, columns = places.shape
        extent = (0, columns * CELL, rows * CELL, 0)
        drawn = panel.imshow(places, cmap="inferno", vmin=0, vmax=1, alpha=0.75, extent=extent)
        panel.set_xlim(0, frame.width)
        panel.set_ylim(frame.height, 0)
        _outline(panel, truth, TRUTH, 1.0)
    figure.colorbar(drawn, cax=bar).set_label("LoC, place among cells", fontsize=6)
    bar.tick_params(labelsize=5)
    png = BytesIO()
    figure.savefig(png, format="png", pil_kwargs={"compress_level": 3})
    return png.getvalue()


def draw_pictures(outcome: Outcome, config: Config, folder: Path) -> None:
    """Draw the best and the worst queries of the last row of the table (the first ones without annotations)."""
    wanted = config.report.pictures
    for stale in folder.glob("*.png"):  # of an earlier run into the same folder
        stale.unlink()
    if not wanted:
        return
    *others, last = config.mix.rows
    of_last = percentiles(outcome.maps[last])
    ranked = rank_queries(outcome, of_last)
    if ranked:
        best = ranked[:wanted]
        worst = [query for query in reversed(ranked) if query not in best][:wanted]
        names = {f"best_{i:02d}": query for i, query in enumerate(best, 1)}
        names |= {f"worst_{i:02d}": query for i, query in enumerate(worst, 1)}
    else:
        names = {f"query_{query:04d}": query for query in range(min(wanted, len(outcome.dataset.query)))}
    heat: dict[int, dict[str, NDArray[np.float32]]] = {query: {} for query in names.values()}
    for row in [*others, last]:  # only what is drawn is kept: the cells of all queries and methods fill GBs
        places = of_last if row == last else percentiles(outcome.maps[row])
        for query in heat:
            heat[query][row] = places[query].copy()
    with mpl.rc_context({"font.family": "DejaVu Sans"}):
        jobs = [(name, partial(draw_query, outcome, heat[query], query)) for name, query in names.items()]
        for name, draw in progress(jobs, len(jobs), "pictures"):
            write_atomically(folder / f"{name}.png", draw())
