"""Change detectors: a plain dict from the name in a mix to what finds the change in every query."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from fdslam.context import Context, Detected
from fdslam.detectors import anomaly, compact, comparison, early, fault_diagnosis


@dataclass(frozen=True)
class Detector:
    """One detector."""

    detect: Callable[[Context], Detected]
    prepare: Callable[[Context], None]  # makes what it keeps of the map, and reads all of it; no query is looked at
    learns: Literal["nothing", "once", "again"]  # of all map images; *once*: it may stay as it is when the map grows


DETECTORS: dict[str, Detector] = {
    "FD": Detector(fault_diagnosis.detect, fault_diagnosis.prepare, "nothing"),
    "PC": Detector(comparison.detect, comparison.prepare, "nothing"),
    "AD": Detector(anomaly.detect, anomaly.prepare, "again"),
    "CC": Detector(compact.detect, compact.prepare, "once"),
    "WC": Detector(compact.new_words, compact.prepare, "once"),
    "MW": Detector(compact.missing_words, compact.prepare, "once"),
    "EF": Detector(early.detect, early.prepare, "once"),
}
