"""The accuracy table for people: as text and as Markdown."""

from __future__ import annotations

from fdslam.config import COMPACT, Config
from fdslam.metrics import Figure, Row
from fdslam.modes import deviations
from fdslam.pipeline import Outcome
from fdslam.report.paper import beside_paper
from fdslam.sessions import label, map_images

Grid = list[list[str]]
NOTHING = "–"


def _figure(figure: Figure | None, digits: int) -> str:
    if figure is None:
        return NOTHING
    return f"{figure.value:.{digits}f} ({figure.low:.{digits}f}–{figure.high:.{digits}f})"


def _compact(figure: Figure | None) -> str:
    """Percent with an interval in whole percents: a terminal is narrow, and no interval is known better."""
    return NOTHING if figure is None else f"{figure.value:.1f} ({figure.low:.0f}–{figure.high:.0f})"


def _value(figure: Figure | None) -> str:
    return NOTHING if figure is None else f"{figure.value:.3f}"


def _accuracy(row: Row, config: Config) -> dict[int, Figure | None]:
    """Return the accuracies of the configured pool."""
    return row.pooled if config.evaluation.pool == "all" else row.per_query


def accuracy_grid(outcome: Outcome, config: Config, compact: bool) -> Grid:
    """Return head and one line per method and control; accuracies of the configured pool.

    ``compact`` is for terminals: intervals only where a decision hangs on them, and no F1-max.
    """
    percents = sorted(set(config.evaluation.X))
    names = ["AUROC", "lc-AUROC", "AP"] if compact else ["AUROC", "lc-AUROC", "AP", "F1-max"]
    lines = [["method", *(f"X = {x} %" for x in percents), *names, "solo", "co"]]
    for row in outcome.rows:
        accuracy = _accuracy(row, config)
        areas, lead = row.areas, outcome.leaders.get(row.method)
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
    taught = f", learned from the first {config.learned} map images" if config.learned else ""
    which = f", {len(outcome.pairs)} pairs of sessions" if outcome.pairs else f" {label(data)}".rstrip()
    lines = [
        f"{data.name}{which}: {map_images(data)} map images, {len(data.query)} queries, {boxes}",
        f"mode {config.mode}{_but(config)}, OBBs {config.obb.library}, Y = {config.evaluation.Y}, "
        f"mask {config.mask.source}, viewpoint {config.evaluation.viewpoint}{taught}",
    ]
    bare = sum(pair.dataset.boxes is None for pair in outcome.pairs)
    if outcome.rows and bare:
        lines.append(f"{bare} of {len(outcome.pairs)} pairs are not annotated and have no part in what follows")
    if outcome.kept:
        lines.append(f"kept per map image: {_kept(outcome)}")
    if outcome.recall and all(figure is not None for figure in outcome.recall.values()):
        recall = ", ".join(f"@{n} {_figure(figure, 1)}" for n, figure in outcome.recall.items())
        lines.append(f"localisation recall %: {recall}")
    else:
        lines.append("localisation recall: no place ground truth (map.csv and pairs.csv)")
    if outcome.rows:
        pool = "over all queries" if config.evaluation.pool == "all" else "within each query"
        level = round(100 * config.evaluation.confidence)
        lines.append(f"% of changed objects found in the top X % of the cells, ranked {pool} ({level} % intervals)")
    else:
        lines.append("no annotations: the maps of change are drawn, nothing is evaluated")
    return lines


def _kept(outcome: Outcome) -> str:
    """What a map keeps of an image: the detectors of the compact map share one, and it is told beside a JPEG."""
    compact = [name for name in outcome.kept if name in COMPACT]
    alone = {name: size for name, size in outcome.kept.items() if name not in compact}
    together = {f"{', '.join(compact)} together": max(outcome.kept[name] for name in compact)} if compact else {}
    sizes = ", ".join(f"{name} {size / 1024:.0f} KiB" for name, size in {**alone, **together}.items())
    return f"{sizes}; no image" + (
        f", a grey JPEG of it would be {outcome.jpeg / 1024:.0f} KiB" if outcome.jpeg else ""
    )


def by_pair(outcome: Outcome, config: Config) -> Grid:
    """Return head and one line per pair of sessions: recall@1, and what each method finds at the largest X."""
    percent = max(config.evaluation.X)
    methods = [row.method for row in outcome.rows]
    lines = [["query/map", "queries", "objects", "recall@1", *(f"{name}, {percent} %" for name in methods)]]
    for pair in outcome.pairs:
        boxes = pair.dataset.boxes
        recall = pair.recall[min(pair.recall)]
        found = {row.method: _accuracy(row, config)[percent] for row in pair.rows}
        lines.append(
            [
                label(pair.dataset),
                str(len(pair.dataset.query)),
                NOTHING if boxes is None else str(sum(map(len, boxes))),
                NOTHING if recall is None else f"{recall.value:.1f}",
                *(NOTHING if figure is None else f"{figure.value:.1f}" for figure in map(found.get, methods)),
            ]
        )
    return lines


def aligned(grid: Grid, rules: tuple[int, ...]) -> list[str]:
    """Return a grid as lines of text, with a rule below each of the lines numbered in ``rules``."""
    widths = [max(map(len, column)) for column in zip(*grid, strict=True)]
    lines = []
    for i, cells in enumerate(grid):
        head, *rest = (c.ljust(w) if n == 0 else c.rjust(w) for n, (c, w) in enumerate(zip(cells, widths, strict=True)))
        lines.append("  ".join([head, *rest]).rstrip())
        if i in rules:
            lines.append("─" * (sum(widths) + 2 * (len(widths) - 1)))
    return lines


def markdown(grid: Grid) -> list[str]:
    """Return a grid, its first line the head, as lines of Markdown."""
    head, *rest = grid
    lines = [f"| {' | '.join(head)} |", f"|---|{'---:|' * (len(head) - 1)}"]
    return lines + [f"| {' | '.join(cells)} |" for cells in rest]


def table_text(outcome: Outcome, config: Config) -> str:
    """Return the table for a terminal."""
    lines = summary(outcome, config)
    if outcome.rows:
        lines += ["", *aligned(accuracy_grid(outcome, config, compact=True), (0, len(config.mix.rows)))]
    if outcome.pairs:
        narrow = [line[: 4 + len(config.mix.rows)] for line in by_pair(outcome, config)]  # without the controls
        lines += ["", *aligned(narrow, (0,))]
    return "\n".join(lines)


def table_markdown(outcome: Outcome, config: Config) -> str:
    """Return the table as Markdown."""
    lines = [*(f"{line}  " for line in summary(outcome, config)), ""]
    if outcome.rows:
        lines += markdown(accuracy_grid(outcome, config, compact=False))
        lines += [
            "",
            "Beside the paper's Table I (NCLT, % of 986 objects):",
            "",
            *markdown(beside_paper(outcome, config)),
        ]
    if outcome.pairs:
        lines += ["", "By pair of sessions:", "", *markdown(by_pair(outcome, config))]
    return "\n".join(lines) + "\n"
