"""A few of many, evenly spread."""

from __future__ import annotations

import numpy as np


def evenly(total: int, most: int) -> list[int]:
    """Return up to ``most`` of the positions 0 … total - 1; of several the first and the last are among them."""
    return np.linspace(0, total - 1, min(most, total)).round().astype(int).tolist()
