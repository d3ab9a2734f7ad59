"""Mode best on folders or the campus, by the source of dense descriptors: python -m experiments.compact.table [DIR …]

One row per detector and control: boxes found, the location-controlled AUROC of cells and of box means, and what a map
image takes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from experiments.compact.measures import box_mean_auroc, figure
from experiments.compact.prepared import configuration, options
from fdslam.config import Config
from fdslam.metrics import Scene
from fdslam.pipeline import Outcome, run
from fdslam.progress import single_threaded
from fdslam.provenance import Stopwatch
from fdslam.sessions import identities

ROWS = ["FD", "CC", "WC", "MW", "EF", "CC+EF", "FD+CC+EF"]
HEAD = "| data set | looks | rows | X = 5 / 10 / 15 / 20 % | at 10 % | lc-AUROC, cells | lc-AUROC, boxes | KB / image |"


def lines(outcome: Outcome, config: Config, name: str) -> Iterator[str]:
    """Yield one row of Markdown per method."""
    data = outcome.dataset
    scene = Scene.of(data, identities([data]))
    for row in outcome.rows:
        found = " / ".join(f"{one.value:.1f}" for one in row.pooled.values() if one)
        values = scene.flatten(row.method, outcome.maps[row.method])
        boxes = box_mean_auroc(values, scene, config.evaluation, config.seed)
        parts = row.method.split("+")
        kept = f"{max(outcome.kept[part] for part in parts) / 1000:.1f}" if row.method in config.mix.rows else "0"
        at = figure(row.pooled.get(10), 1)
        yield (
            f"| {data.name} | {name} | {row.method} | {found} | {at} | {figure(row.lc_auroc, 3)} "
            f"| {figure(boxes, 3)} | {kept} |"
        )


def main() -> None:
    """Print the table."""
    parser = options(__doc__)
    parser.add_argument("--looks", default="", help="ONNX file of the dense descriptors, if it is another detector")
    parser.add_argument("--gradients", action="store_true", help="descriptors without a network")
    parser.add_argument("--model", default="auto", choices=("auto", "map", "shipped"), help="learner of EF")
    parser.add_argument("--previous", type=int, default=0, help="queries before the present one that count too")
    parser.add_argument("--learned", type=int, default=0, help="the first map images, the only ones learned from")
    asked = parser.parse_args()
    single_threaded()
    print(f"{HEAD}\n|---|---|---|---|---|---|---|---:|", flush=True)
    source = "gradients" if asked.gradients else "network"
    name = "gradients" if asked.gradients else Path(asked.looks or asked.yolo or "yolo_campus.onnx").stem
    for folder in asked.folders or [None]:
        base = configuration(folder, asked.yolo, asked.bing, asked.store)
        compact = replace(base.compact, source=source, weights=asked.looks, previous=asked.previous)
        early = replace(base.early, model=asked.model)
        mix = replace(base.mix, rows=ROWS)
        config = replace(base, compact=compact, early=early, mix=mix, learned=asked.learned)
        outcome = run(config, Stopwatch())
        for line in lines(outcome, config, name):
            print(line, flush=True)
        print(
            f"| {outcome.dataset.name} | | grey JPEG of a map image | | | | | {outcome.jpeg / 1000:.1f} |", flush=True
        )


if __name__ == "__main__":
    main()
