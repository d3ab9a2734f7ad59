"""Random numbers that depend on what they are for, never on the order in which things are listed."""

from __future__ import annotations

import hashlib

import numpy as np


def generator(seed: int, *purpose: str) -> np.random.Generator:
    """Return the random generator of one purpose.

    Args:
        seed: the run's seed, at least 0.
        purpose: what the numbers are for, e.g. ``("ties", "query/0001.jpg")``. Different purposes are independent.

    Returns:
        A generator seeded from the SHA-256 of seed and purpose: the same on every machine.
    """
    digest = hashlib.sha256("\0".join((str(seed), *purpose)).encode()).digest()
    return np.random.default_rng(int.from_bytes(digest, "big"))
