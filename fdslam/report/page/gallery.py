"""Which queries the page shows: as many as it may hold, the worst and the best first."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import chain, zip_longest
from typing import Any

import numpy as np

from fdslam.boxes import Candidate
from fdslam.config import Config
from fdslam.fusion import percentiles
from fdslam.pipeline import Maps, Outcome
from fdslam.progress import in_parallel, progress
from fdslam.report.page.images import blank, heat_map, mask_image, photograph
from fdslam.report.page.records import Records, Shown
from fdslam.report.page.render import as_json
from fdslam.report.pictures import score_queries
from fdslam.types import CELL

HIGHEST = 0.99  # quantile of a query's cells that says how much change a method sees in it
BATCH = 32  # queries that are prepared before it is asked whether more fit


def gallery(
    outcome: Outcome, config: Config, room: int, candidates: Sequence[Sequence[Candidate]] | None = None
) -> dict[str, Any]:
    """Return the queries, in the order of the path, and the images that they name.

    Args:
        outcome: of the run.
        config: of the run.
        room: bytes that all of it may take in the page.
        candidates: per query boxes of what may have changed, to be drawn.
    """
    methods = [name for name in config.mix.rows if name in outcome.maps]
    last = methods[-1]
    places = percentiles(outcome.maps[last])
    order = by_turns(score_queries(outcome, places), len(outcome.dataset.query))
    # Without the heat maps more queries seem to fit than do: these are left out again when all is known.
    chosen, images = _that_fit(order, Records(outcome, config, candidates), config, room)
    seen = {last: _seen(outcome, places, chosen)}
    for method in methods[:-1]:  # only what is shown is kept: the cells of all queries and methods fill GBs
        places = percentiles(outcome.maps[method])
        seen[method] = _seen(outcome, places, chosen)
    for i, record in enumerate(chosen):
        for name in seen[last][i]:
            record[name] = [seen[method][i][name] for method in methods]
    kept = list(_kept(chosen, images, room))
    named = {key for record in kept for key in _named(record)}
    return {
        "methods": methods,
        "percents": sorted(set(config.evaluation.X)),
        "annotated": bool(outcome.rows),
        "predicted": config.evaluation.viewpoint == "predicted",
        "pooling": config.fd.pooling,
        "cell": CELL,
        "map": len(outcome.dataset.map),
        "all": len(outcome.dataset.query),
        "queries": sorted(kept, key=lambda record: record["id"]),
        "images": {key: image for key, image in images.items() if key in named},
    }


def _seen(outcome: Outcome, places: Maps, chosen: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return for each of the chosen queries what one method sees in it; ``places`` are of all queries."""
    scores = score_queries(outcome, places)
    found = []
    for query in (record["id"] - 1 for record in chosen):
        one = places[query]
        seen: dict[str, Any] = {"heat": heat_map(one), "within": heat_map(percentiles([one])[0])}
        seen["highest"] = round(float(np.quantile(one, HIGHEST)), 4)
        found.append(seen | ({"score": round(scores[query], 4)} if scores else {}))
    return found


def by_turns(scores: Sequence[float], count: int) -> list[int]:
    """Return the queries in the order in which they are shown while there is room: worst, best, second worst, …

    Args:
        scores: of every query, larger is better; without any the order is that of the path.
        count: of the queries.
    """
    if not scores:
        return list(range(count))
    worst = sorted(range(count), key=lambda query: (scores[query], query))
    half = (count + 1) // 2
    pairs = zip_longest(worst[:half], reversed(worst[half:]))
    return [query for query in chain.from_iterable(pairs) if query is not None]


def _that_fit(
    order: Sequence[int], records: Records, config: Config, room: int
) -> tuple[list[dict[str, Any]], dict[str, str]]:
    """Return the records of the first queries that fit without their heat maps, and all their images."""
    chosen: list[dict[str, Any]] = []
    images: dict[str, str] = {}
    for begin in range(0, len(order), BATCH):
        batch = order[begin : begin + BATCH]
        wanted = {key: one for query in batch for key, one in records.frames(query).items() if key not in images}
        images |= _photographs(wanted, config.workers)
        for query in batch:
            record = records.record(query)
            if records.outcome.masks is not None:
                record["mask"] = mask_image(records.outcome.masks[query])
            chosen.append(record)
        if len(list(_kept(chosen, images, room))) < len(chosen):
            break
    return chosen, images


def _photographs(wanted: Mapping[str, Shown], workers: int) -> dict[str, str]:
    def draw(key: str, shown: Shown) -> tuple[str, str]:
        return key, photograph(shown.frame.path, shown.side) if shown.there else blank(shown.frame, shown.side)

    jobs = [partial(draw, *one) for one in wanted.items()]
    return dict(progress(in_parallel(jobs, workers), len(jobs), "images of the page"))


def _named(record: dict[str, Any]) -> list[str]:
    return [record["image"], *(one["image"] for one in record["hypotheses"])]


def _kept(records: Sequence[dict[str, Any]], images: Mapping[str, str], room: int) -> Iterator[dict[str, Any]]:
    """Yield the first records that take at most ``room`` bytes with the images that they are the first to name."""
    there: set[str] = set()
    for record in records:
        new = set(_named(record)) - there
        room -= len(as_json(record)) + 1 + sum(len(key) + len(images[key]) + 6 for key in new)
        if room < 0:
            return
        there |= new
        yield record
