"""What tries to break the compact map and early fusion: python -m experiments.compact.controls [DIR …]

Mode best with one thing exchanged at a time, on every folder given (as dataset=folder wants it) or, with none, on the
campus: tables with bootstrap intervals over the queries.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from experiments.compact.leaks import texture_alone, with_pixels
from experiments.compact.learners import learned, made_up, maps_of, other_drive
from experiments.compact.measures import alarms, box_mean_auroc, figure, found_by_area, mean_over, threshold
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
from fdslam.progress import single_threaded

AT = 10  # percent of the cells: X of areas and alarms
PARTS = 3  # of the boxes by area
Named = dict[str, Maps]


def untouched(ready: Prepared) -> Named:
    """Return the maps of the methods as they are."""
    context = ready.context
    own: Named = {"CC": list(compact.detect(context).loc), "EF": list(early.detect(context).loc)}
    return with_fusion(own, context.config.mix.rule)


def exchanged(ready: Prepared, own: Named) -> Iterator[tuple[str, Named]]:
    """Yield every row in which something is exchanged, the quick ones first: its name and the maps of its methods."""
    context, config = ready.context, ready.context.config
    seen = compact.all_evidence(context, ready.kept)
    made, rows = made_up(ready), [*early.rows_of(context, seen)]
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
        both = with_fusion({"CC": own["CC"], "EF": other}, config.mix.rule)
        yield "trained on the other drive", {name: maps for name, maps in both.items() if name != "CC"}

    far = far_hypotheses(context)
    wrong = moved(ready, far)
    aligned = sum(count > 0 for count in agreeing(compact.all_evidence(wrong, ready.kept)))
    yield f"wrong map ({aligned} of {len(seen)} queries align)", untouched(replace(ready, context=wrong))

    over = laid_over(ready, far)
    learner = early.trees_of(context)
    laid: Named = {
        "CC": [compact.compared(one, config.compact) for one in over],
        "EF": maps_of(learner, [*early.rows_of(wrong, over)], own["EF"]),
    }
    yield "wrong map, laid over whole", with_fusion(laid, config.mix.rule)


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
    """Yield the lines of both tables."""
    context, own = ready.context, untouched(ready)
    yield (
        f"| data set | rows | smallest third of the boxes, found at {AT} % | middle | largest "
        "| alarms per unchanged query | % of them without |\n|---|---|---|---|---|---|---:|"
    )
    for method, maps in own.items():
        yield small_and_false(ready, method, maps)
    yield (
        f"\n| data set | what is exchanged | queries / unchanged / boxes | rows | X = 5 / 10 / 15 / 20 % | at {AT} % "
        "| lc-AUROC, cells | lc-AUROC, box means |\n|---|---|---|---|---|---|---|---|"
    )
    names = [frame.name for frame in context.dataset.query]
    levels = light_levels(folder, names) if folder else [None] * len(names)
    everyone = list(range(len(names)))
    parts = splits(levels, agreeing(compact.all_evidence(context, ready.kept)))
    for name, queries in {"as it is": everyone, **parts}.items():
        for method, maps in own.items():
            yield line(ready, name, method, maps, queries)
    for name, found in exchanged(ready, own):
        for method, maps in found.items():
            yield line(ready, name, method, maps, everyone)


def main() -> None:
    """Print the tables."""
    given = options(__doc__).parse_args()
    single_threaded()
    for folder in given.folders or [None]:
        for ready in prepared(configuration(folder, given.yolo, given.bing, given.store)):
            for one in tables(ready, folder):
                print(one, flush=True)
            print(flush=True)


if __name__ == "__main__":
    main()
