"""Random streams: every random thing of the world has its own generator, named after what it is for."""

from __future__ import annotations

import hashlib

import numpy as np


def stream(seed: int, *names: str | int) -> np.random.Generator:
    """Return the generator of one named thing; equal names give equal numbers in any process and any order.

    Args:
        seed: the world's seed.
        names: what the numbers are for, e.g. ``"view", "query", 7``.

    Returns:
        A fresh PCG64 generator.
    """
    digest = hashlib.sha256("/".join(map(str, names)).encode()).digest()
    words = np.frombuffer(digest[:16], "<u4").tolist()
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, *words])))
