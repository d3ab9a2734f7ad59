"""Change detectors: a plain dict from the name in a mix to a function that finds the change in every query."""

from __future__ import annotations

from collections.abc import Callable

from fdslam.context import Context, Detected
from fdslam.detectors import anomaly, compact, comparison, early, fault_diagnosis

DETECTORS: dict[str, Callable[[Context], Detected]] = {
    "FD": fault_diagnosis.detect,
    "PC": comparison.detect,
    "AD": anomaly.detect,
    "CC": compact.detect,
    "WC": compact.new_words,
    "MW": compact.missing_words,
    "EF": early.detect,
}
