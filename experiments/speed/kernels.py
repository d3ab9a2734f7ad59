"""What compiled kernels cost a process: the first one compiles them, the second loads them from disk."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile

FIRST_USE = """
import time
import numpy as np
from fdslam.bow.words import Words

rng = np.random.default_rng(0)
known, queries = (rng.integers(0, 256, (n, 32), dtype=np.uint8) for n in (20_000, 100))

def use():
    begin = time.perf_counter()
    words = Words(10_000, 32)
    words.append(known)
    words.search(queries)
    return time.perf_counter() - begin

print(use() - use())
"""


def seconds() -> tuple[float, float]:
    """Return the wall time that kernels cost a process that compiles them, and one that finds them compiled."""
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
        command = [sys.executable, "-c", FIRST_USE]
        runs = [subprocess.run(command, env=environment, capture_output=True, text=True, check=True) for _ in range(2)]
    compiled, loaded = (float(done.stdout) for done in runs)
    return compiled, loaded
