"""What a download says while it runs: a bar on a terminal, elsewhere a line now and then."""

from __future__ import annotations

import time
from types import TracebackType

from tqdm import tqdm

from fdslam.progress import readable, say

PLAIN_SECONDS = 30.0  # between two plain lines: downloads take hours
__all__ = ["Meter", "readable", "say"]


class Meter:
    """Shows how many of ``total`` bytes are done."""

    def __init__(self, label: str, total: int) -> None:
        self._label, self._total = label, total
        self._bar = tqdm(total=total, unit="B", unit_scale=True, desc=label, disable=None, dynamic_ncols=True)
        self._last = time.monotonic()

    def __enter__(self) -> Meter:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._bar.close()

    def show(self, done: int) -> None:
        """Say that ``done`` bytes are done in all."""
        if not self._bar.disable:
            self._bar.n = done
            self._bar.update(0)
        elif time.monotonic() - self._last >= PLAIN_SECONDS:
            self._last = time.monotonic()
            say(f"{self._label}: {readable(done)} of {readable(self._total)}")
