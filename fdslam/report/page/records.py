"""What the page tells of one query, as data for its script."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fdslam.boxes import Candidate
from fdslam.config import Config
from fdslam.data.images import is_file
from fdslam.detection import relevance
from fdslam.pipeline import Outcome
from fdslam.report.page.images import LARGE, SMALL, image_key
from fdslam.report.page.why import witnesses
from fdslam.sessions import label
from fdslam.store import sha256_file
from fdslam.types import Boxes, Frame, grid_shape


@dataclass(frozen=True)
class Shown:
    """An image of the page."""

    frame: Frame
    side: int  # pixels of the longer side, at most
    there: bool = True  # a map image may be gone, or another by now: nothing but the page looks at it again


@dataclass(frozen=True)
class Records:
    """The queries of a run, one at a time."""

    outcome: Outcome
    config: Config
    candidates: Sequence[Sequence[Candidate]] | None = None  # per query boxes of what may have changed

    @cached_property
    def parts(self) -> list[tuple[str, int]]:
        """Per query its pair of sessions, and where the map of that pair begins in the map of all."""
        pairs = self.outcome.pairs
        # As in the pipeline: pairs without annotations, where others have some, are no part of the whole.
        parts = [pair for pair in pairs if pair.dataset.boxes is not None] or pairs or (self.outcome,)
        found, start = [], 0
        for part in parts:
            found += [(label(part.dataset), start)] * len(part.dataset.query)
            start += len(part.dataset.map)
        return found

    @cached_property
    def _first_box(self) -> NDArray[np.int64]:
        """Per query the number of its first box among those of all."""
        return np.cumsum([0, *map(len, self.outcome.dataset.boxes or ())])

    def frames(self, query: int) -> dict[str, Shown]:
        """Return the images that a query's record names: its own and the first map image large, the others small."""
        data = self.outcome.dataset
        shown = [Shown(data.query[query], LARGE)]
        for place, m in enumerate(self.outcome.hypotheses[query]):
            shown.append(Shown(data.map[m], SMALL if place else LARGE, _unchanged(data.map[m])))
        return {image_key(one.frame, one.side): one for one in shown}

    def record(self, query: int) -> dict[str, Any]:
        """Return everything about a query but its images and heat maps."""
        outcome, data = self.outcome, self.outcome.dataset
        frame, found, hypotheses = data.query[query], outcome.localizations[query], outcome.hypotheses[query]
        pair, start = self.parts[query]
        return {
            "id": query + 1,
            "name": frame.name,
            "pair": pair,
            "size": [frame.width, frame.height],
            "grid": list(reversed(grid_shape(frame.height, frame.width))),
            "image": image_key(frame, LARGE),
            "obbs": _outlines(found.boxes),
            "silent": len(found.library.xyxy) - len(found.boxes.xyxy),
            "lost": found.lost,
            "truth": self._truth(query),
            **self._boxes(query),
            "hypotheses": [
                {
                    "name": data.map[m].name,
                    "image": image_key(data.map[m], SMALL if place else LARGE),
                    "relevance": round(float(weight), 4),
                    "right": None if data.relevant is None else bool(np.isin(m, data.relevant[query])),
                }
                for place, (m, weight) in enumerate(zip(hypotheses, relevance(found, hypotheses - start), strict=True))
            ],
            "why": witnesses(found, hypotheses, data, start, self.config.fd.pooling),
        }

    def _boxes(self, query: int) -> dict[str, list[list[int]]]:
        if self.candidates is None:
            return {}
        return {"boxes": [np.rint(one.xyxy).astype(int).tolist() for one in self.candidates[query]]}

    def _truth(self, query: int) -> list[dict[str, Any]] | None:
        """Return the changed objects: their boxes, and per method the place in X of the smallest that finds each."""
        boxes = self.outcome.dataset.boxes
        if boxes is None:
            return None
        first = self._first_box[query]
        return [
            {
                "box": [round(float(value), 1) for value in box],
                "grades": {row.method: int(row.grades[first + i]) for row in self.outcome.rows},
            }
            for i, box in enumerate(boxes[query])
        ]


def _unchanged(frame: Frame) -> bool:
    return is_file(frame.path) and sha256_file(frame.path) == frame.digest


def _outlines(boxes: Boxes) -> dict[str, dict[str, Any]]:
    """Return per source how many OBBs it has, and their outlines as one path of SVG."""
    paths: dict[str, list[str]] = {}
    for source, (x0, y0, x1, y1) in zip(boxes.source, np.rint(boxes.xyxy).astype(int), strict=True):
        paths.setdefault(source, []).append(f"M{x0} {y0}H{x1}V{y1}H{x0}Z")
    return {source: {"count": len(lines), "path": "".join(lines)} for source, lines in sorted(paths.items())}
