"""Change detectors: a plain dict from the name in a mix to a function that returns the LoC cells of every query."""

from __future__ import annotations

from collections.abc import Callable

from fdslam.context import Context
from fdslam.detectors import anomaly, comparison, fault_diagnosis
from fdslam.types import Cells

DETECTORS: dict[str, Callable[[Context], list[Cells]]] = {
    "FD": fault_diagnosis.detect,
    "PC": comparison.detect,
    "AD": anomaly.detect,
}
