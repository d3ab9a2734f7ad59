"""Change detectors: a plain dict from the name in a mix to what finds the change in every query."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from fdslam.context import Context, Detected
from fdslam.detectors import anomaly, compact, comparison, early, fault_diagnosis


@dataclass(frozen=True)
class Detector:
    """One detector."""

    detect: Callable[[Context], Detected]
    prepare: Callable[[Context], None]  # makes what it keeps of the map, and reads all of it; no query is looked at


DETECTORS: dict[str, Detector] = {
    "FD": Detector(fault_diagnosis.detect, fault_diagnosis.prepare),
    "PC": Detector(comparison.detect, comparison.prepare),
    "AD": Detector(anomaly.detect, anomaly.prepare),
    "CC": Detector(compact.detect, compact.prepare),
    "WC": Detector(compact.new_words, compact.prepare),
    "MW": Detector(compact.missing_words, compact.prepare),
    "EF": Detector(early.detect, early.prepare),
}
