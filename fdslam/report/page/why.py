"""Why a place of a query is held for changed: the OBBs whose own lists disagree most with the strong list."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fdslam.detectors.fault_diagnosis import POOL
from fdslam.types import Dataset, Localization

WITNESSES = 8  # OBBs that are told of


def disagreement(ranks: NDArray[np.integer], pooling: str) -> NDArray[np.float64]:
    """Return how far each weak list is from the strong one: its ranks of the hypotheses, pooled as FD pools.

    Args:
        ranks: int [J, Y], r_j(m_y).
        pooling: ``fd.pooling``, over the hypotheses.

    Returns:
        float64 [J], 1 … M; with no hypothesis there is nothing to disagree with, and all are 0.
    """
    if not ranks.shape[1]:
        return np.zeros(len(ranks))
    return np.asarray(POOL[pooling](ranks, axis=1), np.float64)


def witnesses(
    found: Localization, hypotheses: NDArray[np.int64], data: Dataset, start: int, pooling: str
) -> list[dict[str, Any]]:
    """Return the OBBs that disagree most, the most first; equal ones in the order of the library.

    Args:
        found: the localisation of a query, in the map of its pair of sessions.
        hypotheses: of the query, map ids of ``data``.
        data: of all pairs.
        start: the first map id of the query's pair in ``data``.
        pooling: ``fd.pooling``.
    """
    ranks = found.ranks[:, hypotheses - start]
    far = disagreement(ranks, pooling)
    told = []
    for j in np.argsort(-far, kind="stable")[:WITNESSES]:
        own = found.ranks[j]
        best = np.flatnonzero(own == own.min())  # they share the best rank
        told.append(
            {
                "source": found.boxes.source[j],
                "box": [round(float(value), 1) for value in found.boxes.xyxy[j]],
                "ranks": ranks[j].tolist(),
                "disagreement": round(float(far[j]), 1),
                "silent": len(best) == len(own) > 1,
                "first": data.map[start + int(best[0])].name,
                "ties": len(best) - 1,
            }
        )
    return told
