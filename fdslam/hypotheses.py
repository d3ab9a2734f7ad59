"""The map images that a query is compared with: the first of its strong list or, to spare localisation, true ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fdslam.config import Evaluation
from fdslam.types import Dataset, Localization


def hypotheses(
    config: Evaluation, dataset: Dataset, localizations: Sequence[Localization]
) -> tuple[NDArray[np.int64], ...]:
    """Return per query up to Y map ids, best first; with ``viewpoint: true`` none where the map lacks the place."""
    if config.viewpoint == "predicted":
        return tuple(one.strong[: config.Y].astype(np.int64) for one in localizations)
    assert dataset.relevant is not None  # by the pipeline's check of the truth
    return tuple(places[: config.Y] for places in dataset.relevant)
