"""The tables of a run's page, each a head and lines of text."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from fdslam.config import Config
from fdslam.metrics import Figure
from fdslam.pipeline import Outcome
from fdslam.report.paper import beside_paper
from fdslam.report.tables import NOTHING, Grid, accuracy_grid, by_pair

POOLS = {"all": "cells ranked over all queries", "query": "cells ranked within each query"}


def accuracy(outcome: Outcome, config: Config) -> list[tuple[str, Grid]]:
    """Return the accuracy tables, a title and a grid each: that of the configured pool, then the other."""
    if not outcome.rows:
        return []
    pools = sorted(POOLS, key=lambda pool: pool != config.evaluation.pool)
    level = round(100 * config.evaluation.confidence)
    return [
        (
            f"% of changed objects found in the top X % of the cells, {POOLS[pool]} ({level} % intervals)",
            accuracy_grid(outcome, replace(config, evaluation=replace(config.evaluation, pool=pool)), compact=False),
        )
        for pool in pools
    ]


def recall(outcome: Outcome) -> Grid:
    """Return head and one line per length n of the strong list: the localisation recall."""
    return [["n", "recall@n, %"], *([str(n), _figure(figure)] for n, figure in outcome.recall.items())]


def _figure(figure: Figure | None) -> str:
    return NOTHING if figure is None else f"{figure.value:.1f} ({figure.low:.1f}–{figure.high:.1f})"


def over_y(outcome: Outcome, config: Config) -> Grid:
    """Return head and one line per method: what it finds at the largest X with other numbers of hypotheses."""
    percent, counts = max(config.evaluation.X), sorted(outcome.over_Y)
    lines = [["method", *(f"Y = {y}" for y in counts)]]
    for i, row in enumerate(outcome.over_Y[counts[0]] if counts else ()):
        figures = [outcome.over_Y[y][i].pooled[percent] for y in counts]
        lines.append([row.method, *(NOTHING if figure is None else f"{figure.value:.1f}" for figure in figures)])
    return lines


def stages(run: dict[str, Any]) -> Grid:
    """Return head and one line per stage: seconds as they were and as estimated."""
    expected = run.get("estimated_seconds", {})
    lines = [["stage", "seconds", "estimated"]]
    for name, seconds in run.get("seconds", {}).items():
        lines.append([name, f"{seconds:.1f}", f"{expected[name]:.1f}" if name in expected else NOTHING])
    return lines


def further(outcome: Outcome, config: Config) -> list[tuple[str, Grid]]:
    """Return what stands below the accuracy table, folded: a title and a grid each."""
    found: list[tuple[str, Grid]] = []
    if outcome.over_Y:
        title = f"% found at X = {max(config.evaluation.X)} % with other numbers of hypotheses"
        found.append((title, over_y(outcome, config)))
    if outcome.rows and len(paper := beside_paper(outcome, config)) > 1:
        found.append(("Beside the paper's Table I (NCLT, % of 986 objects)", paper))
    if outcome.pairs:
        found.append(("By pair of sessions", by_pair(outcome, config)))
    return found
