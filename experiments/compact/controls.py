"""What tries to break the compact map and early fusion: python -m experiments.compact.controls [DIR …]

Mode best with one thing exchanged at a time, on every folder given (as dataset=folder wants it) or, with none, on the
campus: tables with bootstrap intervals over the queries.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from experiments.compact.leaks import texture_alone, with_pixels
from experiments.compact.learners import learned, made_up, maps_of, other_drive, query_rows
from experiments.compact.measures import alarms, box_mean_auroc, found_by_area, mean_over, threshold
from experiments.compact.prepared import (
    Maps,
    Prepared,
    configuration,
    measured,
    moved,
    options,
    prepared,
    scene,
    with_fusion,
)
from experiments.compact.splits import agreeing, light_levels, splits
from experiments.compact.wrong import far_hypotheses, laid_over
from fdslam.detectors import compact, early
from fdslam.metrics import Figure
from fdslam.progress import single_threaded
from fdslam.store import Arrays

AT = 10  # percent of the cells: X of areas and alarms
PARTS = 3  # of the boxes by area
Named = dict[str, Maps]


def exchanged(ready: Prepared) -> Iterator[tuple[str, Named]]:
    """Yield every row that looks at all queries, the untouched one first: its name and the maps of its methods."""
    context, config = ready.context, ready.context.config
    seen = compact.all_evidence(context, ready.kept)
    own: Named = {"CC": list(compact.detect(context).loc), "EF": list(early.detect(context).loc)}
    yield "as it is", with_fusion(own, config.mix.rule)

    far = far_hypotheses(context)
    wrong = moved(ready, far)
    lost: Named = {"CC": list(compact.detect(wrong).loc), "EF": list(early.detect(wrong).loc)}
    aligned = sum(count > 0 for count in agreeing(compact.all_evidence(wrong, ready.kept)))
    yield f"wrong map ({aligned} of {len(seen)} queries align)", with_fusion(lost, config.mix.rule)

    trees, over = early.trees_of(context, ready.kept), laid_over(ready, far)
    laid: Named = {
        "CC": [config.compact.fine * one["fine"] + (1 - config.compact.fine) * one["coarse"] for one in over],
        "EF": maps_of(trees, query_rows(ready, over, far), own["EF"]),
    }
    yield "wrong map, laid over whole", with_fusion(laid, config.mix.rule)

    made, rows = made_up(ready), query_rows(ready, seen, context.hypotheses)
    for name, (there, here) in {
        "query alone: density of keypoints": (
            [texture_alone(one) for one in made.rows],
            list(map(texture_alone, rows)),
        ),
        "query alone: that and its pixels": with_pixels(ready, made, rows),
    }.items():
        yield name, {"EF": maps_of(learned(there, made.label, config.early, config.seed), here, own["EF"])}
    other = other_drive(ready, made, rows, own["EF"])
    if other is not None:
        yield "trained on the other drive", with_fusion({"CC": own["CC"], "EF": other}, config.mix.rule)


def figure(one: Figure | None, digits: int) -> str:
    """Return a figure with its interval."""
    return f"{one.value:.{digits}f} ({one.low:.{digits}f}–{one.high:.{digits}f})" if one else "–"


def line(ready: Prepared, name: str, method: str, maps: Maps, queries: list[int]) -> str:
    """Return one row of the first table."""
    context, config = ready.context, ready.context.config
    row, some = measured(method, maps, context, queries), scene(context, queries)
    values = some.flatten(method, [maps[q] for q in queries])
    boxes = box_mean_auroc(values, some, config.evaluation, config.seed)
    found = " / ".join(f"{one.value:.1f}" if one else "–" for one in row.pooled.values())
    at = row.pooled[AT]
    top = f"{at.low:.0f}–{at.high:.0f}" if at else "–"
    counts = f"{len(queries)} / {len(some.unchanged)} / {len(some.objects.area)}"
    return (
        f"| {context.dataset.name} | {name} | {counts} | {method} | {found} | {top} | {figure(row.lc_auroc, 3)} "
        f"| {figure(boxes, 3)} |"
    )


def small_and_false(ready: Prepared, method: str, maps: Maps) -> str:
    """Return one row of the second table: what is found by area, and false alarms of unchanged queries."""
    context, config = ready.context, ready.context.config
    queries = list(range(len(maps)))
    row, some = measured(method, maps, context, queries), scene(context, queries)
    cut = sorted(set(config.evaluation.X)).index(AT)
    found = row.grades[some.objects.listed] <= cut
    parts = found_by_area(found, some, PARTS, config.evaluation, config.seed)
    least = threshold(some.flatten(method, maps), AT)
    boxes = context.dataset.boxes or ()
    counts = [alarms(maps[q], least) for q in queries if not len(boxes[q])]
    each = " | ".join(f"{figure(one, 0)}, to {area:,.0f} px" for area, one in parts)
    false = figure(mean_over(counts, config.evaluation, config.seed), 2)
    none = f"{100 * np.mean(np.array(counts) == 0):.0f}" if counts else "–"
    return f"| {context.dataset.name} | {method} | {each} | {false} | {none} |"


def tables(ready: Prepared, folder: Path | None) -> Iterator[str]:
    """Yield the lines of the first table, then those of the second."""
    context = ready.context
    everyone = list(range(len(context.dataset.query)))
    own: Named = {}
    for name, maps in exchanged(ready):
        own = own or maps
        for method, of_all in maps.items():
            if method != "CC" or "drive" not in name:  # nothing of CC is trained
                yield line(ready, name, method, of_all, everyone)
    seen: list[Arrays] = compact.all_evidence(context, ready.kept)
    names = [frame.name for frame in context.dataset.query]
    levels = light_levels(folder, names) if folder else [None] * len(names)
    for name, queries in splits(levels, agreeing(seen)).items():
        for method, of_all in own.items():
            yield line(ready, name, method, of_all, queries)
    yield (
        f"\n| data set | rows | smallest third of the boxes, found at {AT} % | middle | largest "
        "| alarms per unchanged query | % of them without |\n|---|---|---|---|---|---|---:|"
    )
    for method, of_all in own.items():
        yield small_and_false(ready, method, of_all)


def main() -> None:
    """Print the tables."""
    given = options().parse_args()
    single_threaded()
    for folder in given.folders or [None]:
        for ready in prepared(configuration(folder, given.yolo, given.bing, given.store)):
            print(
                f"| data set | what is exchanged | queries / unchanged / boxes | rows | X = 5 / 10 / 15 / 20 % "
                f"| at {AT} % | lc-AUROC, cells | lc-AUROC, box means |\n|---|---|---|---|---|---|---|---|"
            )
            for one in tables(ready, folder):
                print(one, flush=True)
            print(flush=True)


if __name__ == "__main__":
    main()
