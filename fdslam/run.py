"""The command: ``python -m fdslam.run +experiment=fd_ad_pc``.

Composes the configuration, checks it and its surroundings before anything heavy is imported, runs the stages and prints
the table. Whatever the user can mend ends in one line on standard error and exit status 2.
"""

from __future__ import annotations

import os
import shutil
import sys
import warnings
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

from fdslam.compose import one_line, quote_paths, to_config
from fdslam.config import Config, register
from fdslam.errors import InputError
from fdslam.finished import signature
from fdslam.modes import CONF, overruled
from fdslam.progress import say
from fdslam.sweep import note_failure, note_untracked, reused, unfinish
from fdslam.trackers import check_tracker, track

if TYPE_CHECKING:
    from fdslam.models import Models

USAGE_ERROR, INTERRUPTED = 2, 130
FREE_BYTES = 200_000_000  # what a small run writes; a full disk is told at the start rather than in an hour


def check_surroundings(config: Config) -> Models:
    """Find in the first second what would otherwise end the run late; return the models of the run.

    Raises:
        InputError: the data set lacks something, the store cannot be written, the disk is nearly full, the OBB
            library names something unknown, a model cannot be read, or the tracker lacks something.
    """
    from fdslam.data import check_dataset
    from fdslam.models import load_models, out_of_their_world
    from fdslam.obb import parse_library

    parse_library(config.obb.library)
    check_dataset(config.dataset)
    if config.mask.source == "labels" and config.dataset.kind in ("nclt", "pairs"):
        raise InputError(
            f"mask=labels: dataset={config.dataset.kind} has no label images; run with mask=deeplabv3plus or mask=none"
        )
    check_tracker(config.tracker)
    models = load_models(config)
    if notice := out_of_their_world(config):
        say(notice)
    store = Path(config.store)
    try:
        store.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"store={store}: cannot be made ({error.strerror}); choose another with store=DIR") from error
    if not os.access(store, os.W_OK):
        raise InputError(f"store={store}: not writable; choose another with store=DIR")
    free = shutil.disk_usage(store).free
    if free < FREE_BYTES:
        raise InputError(
            f"store={store}: {free / 1e6:.0f} MB free, at least {FREE_BYTES / 1e6:.0f} MB are needed; "
            "free some or choose another disk with store=DIR"
        )
    return models


@hydra.main(version_base="1.3", config_path=str(CONF), config_name="config")
def _job(composed: DictConfig) -> None:
    try:
        _run(composed)
    except InputError as error:
        # Here, and by SystemExit: an exception that leaves the job is announced by Hydra in lines of its own.
        print(f"fdslam: {error}", file=sys.stderr)
        folder = Path(HydraConfig.get().runtime.output_dir)
        if HydraConfig.get().mode == RunMode.MULTIRUN:
            return note_failure(folder, error)
        with suppress(OSError):  # not empty: something was written, and stays
            folder.rmdir()
        sys.exit(USAGE_ERROR)


def _run(composed: DictConfig) -> None:
    config = to_config(composed)
    if line := overruled(config.mode, HydraConfig.get().overrides.task):
        raise InputError(line)
    models = check_surroundings(config)
    folder = Path(HydraConfig.get().runtime.output_dir)
    made_of = signature(config, models.identity)
    sweep = HydraConfig.get().mode == RunMode.MULTIRUN
    if sweep and reused(folder, config.name, made_of):
        return _track(config, folder, sweep)
    unfinish(folder)
    # Only now: torch, OpenCV and the rest take seconds to import.
    from fdslam.pipeline import run
    from fdslam.provenance import Stopwatch
    from fdslam.report import write_report

    watch = Stopwatch()
    outcome = run(config, watch, models)
    print(write_report(outcome, config, folder, watch, made_of))
    print(f"\n{sum(watch.seconds.values()):.1f} s, written to {os.path.relpath(folder)}")
    _track(config, folder, sweep)


def _track(config: Config, folder: Path, sweep: bool) -> None:
    """Note a finished run down; if a job of a sweep cannot be, that leaves its line, and its results count."""
    label = f"{folder.parent.name}/{folder.name}" if sweep else folder.name
    try:
        track(config.tracker, folder, label)
    except InputError as error:
        if not sweep:
            raise
        print(f"fdslam: {error}", file=sys.stderr)
        note_untracked(folder, error)


def main() -> None:
    """Run the command line; exits with 0, 2 (something the user can mend) or 130 (interrupted)."""
    # Otherwise Hydra prints errors itself, over several lines, and exits with 1.
    os.environ["HYDRA_FULL_ERROR"] = "1"
    warnings.filterwarnings("ignore", module="PIL")  # of a torn file, just before the error that names it
    register()
    sys.argv = quote_paths(sys.argv)
    try:
        _job()
    except (HydraException, OmegaConfBaseException) as error:
        print(f"fdslam: {one_line(error)}", file=sys.stderr)
        sys.exit(USAGE_ERROR)
    except OSError as error:
        name = f"{error.filename}: " if error.filename else ""
        print(
            f"fdslam: {name}{error.strerror or error}; choose other folders with store=… and hydra.run.dir=…",
            file=sys.stderr,
        )
        sys.exit(USAGE_ERROR)
    except KeyboardInterrupt:
        print("fdslam: interrupted; what is finished is kept, run again to go on", file=sys.stderr)
        sys.exit(INTERRUPTED)


if __name__ == "__main__":
    main()
