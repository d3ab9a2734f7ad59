"""What the switches of anomaly detection change, one table a data set.

    python -m experiments.ad.variants dataset=folder dataset.root=../shared/data/camvid_changes
    python -m experiments.ad.variants dataset=campus
    python -m experiments.ad.variants dataset=campus ad=time     # likewise ad=pose

Takes the keys of ``python -m fdslam.run``; rows are AD alone. The autoencoders are trained once for all errors, regions
and hypotheses.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import product

from fdslam.compose import configured
from fdslam.config import Config, Mix
from fdslam.config.ad import ERRORS
from fdslam.pipeline import run
from fdslam.provenance import Stopwatch
from fdslam.run import check_surroundings


def line(config: Config, **switches: str) -> str:
    """Return the row of the table of AD with other switches."""
    outcome = run(replace(config, ad=replace(config.ad, **switches)), Stopwatch())
    row = next(row for row in outcome.rows if row.method == "AD")
    found = " / ".join(f"{row.pooled[x].value:.1f}" for x in config.evaluation.X)
    used = replace(config.ad, **switches)
    area = row.lc_auroc
    return (
        f"| {used.places} | {used.error} | {used.region} | {used.hypotheses} | {found} | "
        f"{area.value:.3f} ({area.low:.3f}–{area.high:.3f}) |"
    )


def main() -> None:
    """Print the table."""
    config = configured(sys.argv[1:])
    config = replace(config, mix=Mix(rows=["AD"]), evaluation=replace(config.evaluation, curve_Y=[]))
    check_surroundings(config)
    tops = " / ".join(map(str, config.evaluation.X))
    print(f"| places | error | region | hypotheses | X = {tops} % | lc-AUROC |\n|---|---|---|---|---|---|")
    for error, region, hypotheses in product(ERRORS, ("pixel", "obb"), ("top1", "min")):
        print(line(config, error=error, region=region, hypotheses=hypotheses), flush=True)


if __name__ == "__main__":
    main()
