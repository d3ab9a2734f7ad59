"""The accuracy table as text, Markdown, CSV and JSON."""

from __future__ import annotations

import csv
import io
from typing import Any

from fdslam.config import Config
from fdslam.metrics import Figure, Row
from fdslam.modes import deviations
from fdslam.pipeline import Outcome

Grid = list[list[str]]
NOTHING = "–"


def _figure(figure: Figure | None, digits: int) -> str:
    if figure is None:
        return NOTHING
    return f"{figure.value:.{digits}f} ({figure.low:.{digits}f}–{figure.high:.{digits}f})"


def _areas(row: Row) -> dict[str, Figure | None]:
    return {"AUROC": row.auroc, "lc-AUROC": row.lc_auroc, "AP": row.ap, "F1-max": row.f1_max}


def _compact(figure: Figure | None) -> str:
    """Percent with an interval in whole percents: a terminal is narrow, and no interval is known better."""
    return NOTHING if figure is None else f"{figure.value:.1f} ({figure.low:.0f}–{figure.high:.0f})"


def _value(figure: Figure | None) -> str:
    return NOTHING if figure is None else f"{figure.value:.3f}"


def _grid(outcome: Outcome, config: Config, compact: bool) -> Grid:
    """Head and one line per method and control; accuracies of the configured pool.

    ``compact`` is for terminals: intervals only where a decision hangs on them, and no F1-max.
    """
    percents = sorted(set(config.evaluation.X))
    names = ["AUROC", "lc-AUROC", "AP"] if compact else ["AUROC", "lc-AUROC", "AP", "F1-max"]
    lines = [["method", *(f"X = {x} %" for x in percents), *names, "solo", "co"]]
    for row in outcome.rows:
        accuracy = row.pooled if config.evaluation.pool == "all" else row.per_query
        areas, lead = _areas(row), outcome.leaders.get(row.method)
        lines.append(
            [
                row.method,
                *(_compact(accuracy[x]) if compact else _figure(accuracy[x], 1) for x in percents),
                *(_value(areas[n]) if compact and n != "lc-AUROC" else _figure(areas[n], 3) for n in names),
                *((f"{lead.solo:.1f}", f"{lead.co:.1f}") if lead else (NOTHING, NOTHING)),
            ]
        )
    return lines


def _but(config: Config) -> str:
    """What is not as the mode says: a table must not call itself the paper's when it is something else."""
    return "".join(f" but {key}={value}" for key, value in deviations(config).items())


def summary(outcome: Outcome, config: Config) -> list[str]:
    """Return the lines above the table: the data, the setting and the localisation recall."""
    data = outcome.dataset
    boxes = "no annotations" if data.boxes is None else f"{sum(map(len, data.boxes))} changed objects"
    lines = [
        f"{data.name}: {len(data.map)} map images, {len(data.query)} queries, {boxes}",
        f"mode {config.mode}{_but(config)}, OBBs {config.obb.library}, Y = {config.evaluation.Y}, "
        f"mask {config.mask.source}, viewpoint {config.evaluation.viewpoint}",
    ]
    kept = ", ".join(f"{name} {size / 1024:.0f} KiB" for name, size in outcome.kept.items())
    lines.append(f"kept per map image: {kept}; no image")
    if all(figure is not None for figure in outcome.recall.values()):
        recall = ", ".join(f"@{n} {_figure(figure, 1)}" for n, figure in outcome.recall.items())
        lines.append(f"localisation recall %: {recall}")
    else:
        lines.append("localisation recall: no place ground truth (map.csv and pairs.csv)")
    if outcome.rows:
        pool = "over all queries" if config.evaluation.pool == "all" else "within each query"
        level = round(100 * config.evaluation.confidence)
        lines.append(f"% of changed objects found in the top X % of the cells, ranked {pool} ({level} % intervals)")
    else:
        lines.append("no annotations.json: the maps of change are drawn, nothing is evaluated")
    return lines


def table_text(outcome: Outcome, config: Config) -> str:
    """Return the table for a terminal."""
    lines = summary(outcome, config)
    if outcome.rows:
        grid = _grid(outcome, config, compact=True)
        widths = [max(map(len, column)) for column in zip(*grid, strict=True)]
        lines.append("")
        for i, cells in enumerate(grid):
            head, *rest = (
                c.ljust(w) if n == 0 else c.rjust(w) for n, (c, w) in enumerate(zip(cells, widths, strict=True))
            )
            lines.append("  ".join([head, *rest]).rstrip())
            if i in (0, len(config.mix.rows)):
                lines.append("─" * (sum(widths) + 2 * (len(widths) - 1)))
    return "\n".join(lines)


def table_markdown(outcome: Outcome, config: Config) -> str:
    """Return the table as Markdown."""
    lines = [*(f"{line}  " for line in summary(outcome, config)), ""]
    if outcome.rows:
        head, *rest = _grid(outcome, config, compact=False)
        lines += [f"| {' | '.join(head)} |", f"|---|{'---:|' * (len(head) - 1)}"]
        lines += [f"| {' | '.join(cells)} |" for cells in rest]
    return "\n".join(lines) + "\n"


def table_csv(outcome: Outcome, config: Config) -> str:
    """Return the table as CSV, one line per method, pool and figure: method, pool, figure, value, low, high."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["method", "pool", "figure", "value", "low", "high"])
    for row in outcome.rows:
        figures: list[tuple[str, str, Figure | None]] = []
        for pool, accuracy in (("all", row.pooled), ("query", row.per_query)):
            figures += [(pool, f"top-{x}", figure) for x, figure in accuracy.items()]
        figures += [("all", name, figure) for name, figure in _areas(row).items()]
        for pool, name, figure in figures:
            values = ["", "", ""] if figure is None else [figure.value, figure.low, figure.high]
            writer.writerow([row.method, pool, name, *values])
        if lead := outcome.leaders.get(row.method):
            writer.writerow([row.method, "all", "solo-leader", lead.solo, "", ""])
            writer.writerow([row.method, "all", "co-leader", lead.co, "", ""])
    return text.getvalue()


def _entry(figure: Figure | None) -> dict[str, float | None]:
    if figure is None:
        return {"value": None, "low": None, "high": None}
    return {"value": figure.value, "low": figure.low, "high": figure.high}


def table_json(outcome: Outcome, config: Config, seconds: float) -> dict[str, Any]:
    """Return the table for programs: accuracies and recalls in percent, areas in 0 … 1, null where undefined."""
    rows = []
    for row in outcome.rows:
        lead = outcome.leaders.get(row.method)
        rows.append(
            {
                "method": row.method,
                "pooled": {str(x): _entry(figure) for x, figure in row.pooled.items()},
                "per_query": {str(x): _entry(figure) for x, figure in row.per_query.items()},
                "auroc": _entry(row.auroc),
                "lc_auroc": _entry(row.lc_auroc),
                "ap": _entry(row.ap),
                "f1_max": _entry(row.f1_max),
                "solo_leader": lead.solo if lead else None,
                "co_leader": lead.co if lead else None,
            }
        )
    data = outcome.dataset
    return {
        "dataset": data.name,
        "map": len(data.map),
        "query": len(data.query),
        "boxes": None if data.boxes is None else sum(map(len, data.boxes)),
        "mode": config.mode,
        "deviations": deviations(config),
        "obb": config.obb.library,
        "Y": config.evaluation.Y,
        "seconds": round(seconds, 3),
        "localization": {f"recall@{n}": _entry(figure) for n, figure in outcome.recall.items()},
        "kept_bytes_per_map_image": {name: round(size) for name, size in outcome.kept.items()},
        "rows": rows,
    }
