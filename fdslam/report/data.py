"""The accuracy table for programs: as CSV and JSON."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator
from typing import Any

from fdslam.config import Config
from fdslam.metrics import Figure
from fdslam.modes import deviations
from fdslam.pipeline import Outcome
from fdslam.sessions import map_images

COLUMNS = ["method", "pool", "figure", "value", "low", "high"]


def _csv(rows: Iterable[list[Any]]) -> str:
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def _lines(outcome: Outcome) -> Iterator[list[Any]]:
    for row in outcome.rows:
        figures: list[tuple[str, str, Figure | None]] = []
        for pool, accuracy in (("all", row.pooled), ("query", row.per_query)):
            figures += [(pool, f"top-{x}", figure) for x, figure in accuracy.items()]
        figures += [("all", name, figure) for name, figure in row.areas.items()]
        for pool, name, figure in figures:
            values = ["", "", ""] if figure is None else [figure.value, figure.low, figure.high]
            yield [row.method, pool, name, *values]
        if lead := outcome.leaders.get(row.method):
            yield [row.method, "all", "solo-leader", lead.solo, "", ""]
            yield [row.method, "all", "co-leader", lead.co, "", ""]


def table_csv(outcome: Outcome) -> str:
    """Return the table as CSV, one line per method, pool and figure: method, pool, figure, value, low, high."""
    return _csv([COLUMNS, *_lines(outcome)])


def pairs_csv(outcome: Outcome) -> str:
    """Return the tables of all pairs of sessions as CSV: query, map, then the columns of ``table_csv``."""
    rows = [[*(pair.dataset.pair or ()), *line] for pair in outcome.pairs for line in _lines(pair)]
    return _csv([["query", "map", *COLUMNS], *rows])


def training_csv(outcome: Outcome) -> str:
    """Return how the autoencoders were trained as CSV, one line per loss: map, place, images, figure, step, L1.

    The steps of ``training`` are epochs of the final network, those of ``held-out`` the folds, each with its best
    epoch's loss.
    """
    lines = []
    for one in outcome.training:
        for figure, losses in (("training", one.training), ("held-out", one.held_out)):
            lines += [[one.map, one.place, one.images, figure, step, loss] for step, loss in enumerate(losses, 1)]
    return _csv([["map", "place", "images", "figure", "step", "L1"], *lines])


def _entry(figure: Figure | None) -> dict[str, float | None]:
    if figure is None:
        return {"value": None, "low": None, "high": None}
    return {"value": figure.value, "low": figure.low, "high": figure.high}


def _measured(outcome: Outcome) -> dict[str, Any]:
    """Return what is told of all queries together, and in the same words of each pair."""
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
        "map": map_images(data),
        "query": len(data.query),
        "boxes": None if data.boxes is None else sum(map(len, data.boxes)),
        "localization": {f"recall@{n}": _entry(figure) for n, figure in outcome.recall.items()},
        "rows": rows,
    }


def table_json(outcome: Outcome, config: Config, seconds: float) -> dict[str, Any]:
    """Return the table for programs: accuracies and recalls in percent, areas in 0 … 1, null where undefined."""
    over = {
        str(y): {row.method: {str(x): None if f is None else f.value for x, f in row.pooled.items()} for row in rows}
        for y, rows in outcome.over_Y.items()
    }
    pairs = []
    for pair in outcome.pairs:
        query, against = pair.dataset.pair or ("", "")
        pairs.append({"query_session": query, "map_session": against, **_measured(pair)})
    return {
        "dataset": outcome.dataset.name,
        "pair": outcome.dataset.pair,
        "mode": config.mode,
        "deviations": deviations(config),
        "obb": config.obb.library,
        "Y": config.evaluation.Y,
        "seconds": round(seconds, 3),
        "kept_bytes_per_map_image": {name: round(size) for name, size in outcome.kept.items()},
        "grey_jpeg_bytes": round(outcome.jpeg),
        **_measured(outcome),
        "over_Y": over,
        "pairs": pairs,
    }
