"""Where a result comes from: seeds, versions, threads, commit, configuration, and how long each stage took."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import resource
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

LIBRARIES = (
    "fdslam", "torch", "torchvision", "hydra-core", "omegaconf", "opencv-python-headless", "kornia", "scikit-learn",
    "onnxruntime", "numpy", "scipy", "numba", "safetensors", "pillow", "matplotlib",
)  # fmt: skip


class Stopwatch:
    """Seconds of wall-clock time per stage, in the order of the stages."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.expected: dict[str, float] = {}  # likewise, as estimated before the run

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time that passes inside to the stage ``name``."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start


def git_commit() -> str | None:
    """Return the commit of the checkout this package runs from, with ``-dirty`` after local changes; None elsewhere."""
    here = Path(__file__).parent
    command = ["git", "-C", str(here), "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    if not (here.parent / ".git").exists():
        return None
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip() or None
    except (OSError, subprocess.SubprocessError):
        return None


def _version(name: str) -> str | None:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def versions() -> dict[str, str | None]:
    """Return the versions of the libraries that decide results; None for one that is absent."""
    return {name: _version(name) for name in LIBRARIES}


def provenance(config: dict[str, Any], watch: Stopwatch, workers: int) -> dict[str, Any]:
    """Return what ``run.json`` holds."""
    return {
        "command": sys.argv,
        "seed": config["seed"],
        "git_commit": git_commit(),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "versions": versions(),
        "threads": {"workers": workers, "per_worker": 1},
        "cores": os.cpu_count(),
        "peak_memory_mib": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, 1),
        "seconds": {name: round(value, 3) for name, value in watch.seconds.items()},
        "estimated_seconds": {name: round(value, 1) for name, value in watch.expected.items()},
        "config": config,
    }
