"""Kill a run at random moments, start it again each time, and compare the final table with that of an unbroken run.

    python -m experiments.robustness.kill_and_resume --kills 10 +experiment=fd_ad_pc

Everything after the options goes to ``fdslam.run``. A moment is a random number of finished artefacts and a random
fraction of a second after it, so that the kills spread over all stages however fast the machine is; SIGKILL cannot be
caught, so nothing gets the chance to tidy up. Exit status 1 if the tables differ in a single digit.
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


def artefacts(store: Path) -> int:
    """Return how many artefacts are finished."""
    return sum(1 for _ in store.rglob("*.safetensors"))


def kill_at(run: subprocess.Popen, store: Path, count: int, delay: float) -> bool:
    """Kill a run ``delay`` seconds after ``count`` artefacts are there; return False if it ended before."""
    while artefacts(store) < count and run.poll() is None:
        time.sleep(0.01)
    try:
        run.wait(delay)
    except subprocess.TimeoutExpired:
        run.send_signal(signal.SIGKILL)
        run.wait()
        return True
    return False


def kill_and_resume(kills: int, seed: int, overrides: list[str]) -> tuple[bool, list[float]]:
    """Kill and start again, printing what happens.

    Returns:
        Whether the last table equals that of an unbroken run, and for every kill the share of all artefacts that were
        finished by then.
    """
    moments, shares = random.Random(seed), []
    with tempfile.TemporaryDirectory() as folder:
        base = Path(folder)
        table, seconds = complete(base / "unbroken", base / "unbroken_out", overrides)
        total = artefacts(base / "unbroken")
        print(f"unbroken run: {seconds:.1f} s, {total} artefacts")
        for n, count in enumerate(sorted(moments.randint(0, total) for _ in range(kills)), 1):
            run = start(base / "killed", base / f"killed_out_{n}", overrides)
            if kill_at(run, base / "killed", count, moments.uniform(0, 0.5)):
                shares.append(artefacts(base / "killed") / total)
                print(f"run {n}: killed with {round(shares[-1] * total)} artefacts")
            else:
                print(f"run {n}: ended before its moment")
        again, seconds = complete(base / "killed", base / "last_out", overrides)
        print(f"last run: {seconds:.1f} s, table {'identical' if again == table else 'DIFFERENT'}")
    return again == table, shares


def main() -> None:
    """Parse the command line and exit with 0 if the tables are identical."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    options, overrides = parser.parse_known_args()
    same, _ = kill_and_resume(options.kills, options.seed, overrides)
    sys.exit(not same)


if __name__ == "__main__":
    main()
