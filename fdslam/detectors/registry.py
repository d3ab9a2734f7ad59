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
    learns: bool  # from map images together: when the map grows, again from all, or it stays as it was


DETECTORS: dict[str, Detector] = {
    "FD": Detector(fault_diagnosis.detect, fault_diagnosis.prepare, learns=False),
    "PC": Detector(comparison.detect, comparison.prepare, learns=False),
    "AD": Detector(anomaly.detect, anomaly.prepare, learns=True),
    "CC": Detector(compact.detect, compact.prepare, learns=True),
    "WC": Detector(compact.new_words, compact.prepare, learns=True),
    "MW": Detector(compact.missing_words, compact.prepare, learns=True),
    "EF": Detector(early.detect, early.prepare, learns=True),
}
