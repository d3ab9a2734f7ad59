"""Kill a run at random moments, start it again each time, and compare the final table with that of an unbroken run.

    python -m experiments.robustness.kill_and_resume --kills 10 +experiment=fd_ad_pc

Everything after the options goes to ``fdslam.run``. The moments are drawn uniformly over the time that the unbroken run
took, so that they fall into every stage; SIGKILL cannot be caught, so nothing gets the chance to tidy up. Exit status 1
if the tables differ in a single digit.
"""

from __future__ import annotations

import argparse
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def start(store: Path, out: Path, overrides: list[str]) -> subprocess.Popen:
    """Start a run that keeps its artefacts in ``store`` and writes its table to ``out``."""
    command = [sys.executable, "-m", "fdslam.run", *overrides, f"store={store}", f"hydra.run.dir={out}"]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def complete(store: Path, out: Path, overrides: list[str]) -> tuple[bytes, float]:
    """Run to the end; return table.csv and the seconds it took.

    Raises:
        RuntimeError: the run failed.
    """
    begin = time.monotonic()
    status = start(store, out, overrides).wait()
    if status:
        raise RuntimeError(f"fdslam.run ended with status {status}: {' '.join(overrides)}")
    return (out / "table.csv").read_bytes(), time.monotonic() - begin


def kill_and_resume(kills: int, seed: int, overrides: list[str]) -> bool:
    """Return whether ``kills`` kills leave the table as it is, printing what happens."""
    moments = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        base = Path(folder)
        table, seconds = complete(base / "unbroken", base / "unbroken_out", overrides)
        print(f"unbroken run: {seconds:.1f} s")
        for n in range(kills):
            # Each life goes on where the last one ended, so lives of T / kills on average cover the whole run.
            life = moments.uniform(0.1, max(0.2, 2 * seconds / kills))
            run = start(base / "killed", base / f"killed_out_{n}", overrides)
            try:
                run.wait(life)
                print(f"run {n + 1}: finished before its {life:.1f} s")
            except subprocess.TimeoutExpired:
                run.send_signal(signal.SIGKILL)
                run.wait()
                files = sum(1 for _ in (base / "killed").rglob("*.safetensors"))
                print(f"run {n + 1}: killed after {life:.1f} s, {files} artefacts kept")
        again, seconds = complete(base / "killed", base / "last_out", overrides)
        same = again == table
        print(f"last run: {seconds:.1f} s, table {'identical' if same else 'DIFFERENT'}")
    return same


def main() -> None:
    """Parse the command line and exit with 0 if the tables are identical."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    options, overrides = parser.parse_known_args()
    sys.exit(not kill_and_resume(options.kills, options.seed, overrides))


if __name__ == "__main__":
    main()
