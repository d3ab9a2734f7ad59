"""How long a run's page takes to build from stored artefacts, and to open: python -m experiments.speed.report OVERRIDES

The overrides are those of a run that was made before into the same store; it is gone through again, and the page is
written beside nothing else. It is opened from disk in Chromium a few times, each in a new window, and the fastest is
told: until the page is loaded, and until the first queries are shown; beside it what loading costs the processor, as
other work may run on the machine.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from dataclasses import asdict
from pathlib import Path

from playwright.sync_api import Browser, sync_playwright

from fdslam.compose import configured
from fdslam.pipeline import run
from fdslam.progress import worker_count
from fdslam.provenance import Stopwatch, provenance
from fdslam.report.page import write_page
from fdslam.report.tables import markdown

TIMES = 5
FIRST = "[...document.querySelectorAll('#cards .scene .photo')].some((image) => image.complete && image.naturalWidth)"


def opened(browser: Browser, address: str) -> tuple[float, float, float]:
    """Return seconds until it is loaded, of the processor until then, and until a query is shown, of the fastest."""
    found = []
    for _ in range(TIMES):
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.set_default_timeout(120_000)
        session = page.context.new_cdp_session(page)
        session.send("Performance.enable", {"timeDomain": "threadTicks"})
        begin = time.perf_counter()
        page.goto(f"{address}#gallery")
        loaded = time.perf_counter() - begin
        told = {one["name"]: one["value"] for one in session.send("Performance.getMetrics")["metrics"]}
        page.wait_for_function(FIRST)
        found.append((time.perf_counter() - begin, loaded, told["TaskDuration"]))
        page.close()
    shown, loaded, busy = min(found)
    return loaded, busy, shown


def main() -> None:
    """Measure and print."""
    config = configured(sys.argv[1:])
    watch = Stopwatch()
    outcome = run(config, watch)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        path = Path(folder) / "report.html"
        begin, busy = time.perf_counter(), time.process_time()
        write_page(outcome, config, path, provenance(asdict(config), watch, worker_count(config.workers)))
        built, worked = time.perf_counter() - begin, time.process_time() - busy
        chromium = shutil.which("chromium") or shutil.which("chromium-browser")
        browser = playwright.chromium.launch(
            executable_path=chromium, args=["--disable-gpu", *(["--no-sandbox"] if os.geteuid() == 0 else [])]
        )
        loaded, opening, shown = opened(browser, path.as_uri())
        browser.close()
        size = path.stat().st_size / 1e6
    head = ["data", "queries", "build, s", "processor, s", "MB", "open, s", "processor, s", "queries shown, s"]
    line = [f"{value:.2f}" for value in (built, worked, size, loaded, opening, shown)]
    print("\n".join(markdown([head, [outcome.dataset.name, str(len(outcome.dataset.query)), *line]])))


if __name__ == "__main__":
    main()
