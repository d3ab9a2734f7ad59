"""Change detectors: a plain dict from the name in a mix to what it does and what it keeps of the map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.context import Context
from fdslam.detectors import anomaly, comparison, fault_diagnosis


@dataclass(frozen=True)
class Detector:
    """One detector."""

    detect: Callable[[Context], Sequence[NDArray[np.floating]]]  # per query the LoC [rows, columns] of its cells
    kept: Callable[[Context], float]  # bytes per map image that it keeps beside the bag of words, once it has detected


DETECTORS = {
    "FD": Detector(fault_diagnosis.detect, fault_diagnosis.kept),
    "PC": Detector(comparison.detect, comparison.kept),
    "AD": Detector(anomaly.detect, anomaly.kept),
}
