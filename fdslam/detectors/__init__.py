"""Change detectors: a plain dict from the name in a mix to a function that returns the LoC cells of every query."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from fdslam.context import Context
from fdslam.detectors import anomaly, comparison, fault_diagnosis

DETECTORS: dict[str, Callable[[Context], Sequence[NDArray[np.floating]]]] = {
    "FD": fault_diagnosis.detect,
    "PC": comparison.detect,
    "AD": anomaly.detect,
}
