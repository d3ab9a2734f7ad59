"""What a live image tells: where it was taken, and what has changed there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.boxes import Candidate, candidates
from fdslam.fusion import percentiles
from fdslam.localization import RECIPROCAL_ONE, reciprocal
from fdslam.pipeline import Outcome
from fdslam.types import CELL, Boxes, Localization


@dataclass(frozen=True)
class Hypothesis:
    """A map image that may show the place."""

    image: int  # map id
    name: str  # of the map image
    relevance: float  # Σ_j 1 / r_j over the weak lists, by which the strong list is sorted


@dataclass(frozen=True, eq=False, repr=False)  # arrays are neither equal nor unequal
class Detection:
    """What one image tells."""

    name: str  # of the image
    height: int  # of the image, pixels
    width: int
    hypotheses: tuple[Hypothesis, ...]  # the first Y of the strong list, best first
    lost: bool  # no weak list tells one map image from another: the hypotheses say nothing
    cells: NDArray[np.floating]  # [ceil(H / 10), ceil(W / 10)] LoC, larger is more likely changed
    places: NDArray[np.float32]  # of the same shape: each cell's place among all cells of the pool, 0 … 1
    obbs: Boxes  # the J OBBs that the image was localised by
    ranks: NDArray[np.integer]  # [J, Y] r_j(m_y): the rank that the weak list of OBB j gives to hypothesis y
    localization: Localization  # all weak lists, the whole strong list, and the OBBs that hold too few keypoints

    def __repr__(self) -> str:
        """Say which image this is, and where it was taken: the arrays would fill a screen."""
        place = "lost" if self.lost or not self.hypotheses else f"at {self.hypotheses[0].name!r}"
        return f"Detection({self.name!r}, {self.width}×{self.height}, {place}, {len(self.obbs.xyxy)} OBBs)"

    @property
    def pixels(self) -> NDArray[np.float32]:
        """LoC of every pixel, float32 [H, W]: that of its cell."""
        return self.cells.repeat(CELL, 0).repeat(CELL, 1)[: self.height, : self.width].astype(np.float32)

    def candidates(self, share: float = 5.0, top: int = 10) -> tuple[Candidate, ...]:
        """Return boxes of what may have changed, best first.

        Args:
            share: percent of the pool's cells that count as likely changed.
            top: the most boxes.

        Returns:
            Candidates with ``xyxy``, float32 [4] pixels, and ``score``.
        """
        return candidates(self.places, self.height, self.width, share, top)


def relevance(found: Localization, images: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return Σ_j 1 / r_j(m) of map images, float64 of the same length: what the strong list is sorted by."""
    return reciprocal(found.ranks[:, images].astype(np.int32)).sum(axis=0) / RECIPROCAL_ONE


def detections(outcome: Outcome, row: str) -> list[Detection]:
    """Return what every query of an outcome tells by one row of its table."""
    data, maps = outcome.dataset, outcome.maps[row]
    found = []
    for query, (frame, cells, places) in enumerate(zip(data.query, maps, percentiles(maps), strict=True)):
        where, best = outcome.localizations[query], outcome.hypotheses[query]
        ranks = where.ranks[:, best]
        hypotheses = tuple(
            Hypothesis(int(m), data.map[m].name, float(value))
            for m, value in zip(best, relevance(where, best), strict=True)
        )
        found.append(
            Detection(
                frame.name,
                frame.height,
                frame.width,
                hypotheses,
                where.lost,
                cells,
                places,
                where.boxes,
                ranks,
                where,
            )
        )
    return found
