"""Commands of the pages, run or, where that takes too long, only read.

Commands of the project run in this process, where torch is loaded once; all others in a shell.
"""

import argparse
import glob
import importlib.util
import inspect
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

from hydra import compose, initialize_config_dir
from hydra.core.override_parser.overrides_parser import OverridesParser

from fdslam import run
from fdslam.modes import CONF, overruled

# Keys that make a run small, where a command does not say otherwise.
QUICK = (
    "ad.k=2", "ad.epochs=2", "ad.folds=2", "ad.channels=4", "ad.latent=8", "ad.pixels=1024", "bow.features=300",
    "bow.min_side=240", "evaluation.bootstrap=20", "evaluation.curve_Y=[]", "report.pictures=0",
)  # fmt: skip
PATH = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])  # as in the activated environment
SIZES = {"images": 56, "width": 154, "height": 202, "objects": 240, "distractors": 48}  # of the campus


def execute(command, monkeypatch, capsys):
    """Run one command; return the lines that it prints and its exit status."""
    words = shlex.split(command) if "\n" not in command else []
    if words[:2] == ["python", "-m"]:
        monkeypatch.setattr(sys, "argv", [words[2], *expanded(words[3:])])
        try:
            status = main(words[2])() or 0
        except SystemExit as ended:
            status = ended.code or 0
        captured = capsys.readouterr()
        errors = [line for line in captured.err.splitlines() if line.startswith("fdslam: ")]
        return captured.out.splitlines() + errors, status
    shell = f'python() {{ {shlex.quote(sys.executable)} "$@"; }}\n{command}'
    done = subprocess.run(
        ["bash", "-ec", shell],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"LC_ALL": "C", "PATH": PATH},
    )
    return done.stdout.splitlines() + done.stderr.splitlines(), done.returncode


def main(module):
    """Return the function that ``python -m`` calls."""
    is_package = importlib.util.find_spec(module).submodule_search_locations is not None
    return importlib.import_module(f"{module}.__main__" if is_package else module).main


def expanded(words):
    """Return the words as a shell hands them on: patterns become the files that there are."""
    return [name for word in words for name in (sorted(glob.glob(word)) if "*" in word else []) or [word]]


def small(command, store):
    """Return a command made small, in a store of the tests."""
    words = command.split()
    if words[:3] == ["python", "-m", "experiments.table1.campus_as_nclt"]:
        return f"{command} {' '.join(f'--{name} {value}' for name, value in SIZES.items())} --store {store}"
    if words[:3] != ["python", "-m", "fdslam.run"]:
        return command
    said = {word.partition("=")[0] for word in words}
    campus = [] if "dataset" in said else [f"dataset.{name}={value}" for name, value in SIZES.items()]
    extra = [one for one in (*QUICK, *campus) if one.partition("=")[0] not in said]
    return shlex.join([*words, *extra, f"store={store}"])


class Parsed(Exception):
    """A command was understood; it goes no further."""


def understood(command, monkeypatch):
    """Check a command as far as its own parser goes: Hydra composes the configuration, argparse knows each option."""
    _, _, module, *words = shlex.split(command)
    if module == "fdslam.run":
        return composed(words)
    found = main(module)
    code = inspect.getsource(found)
    readers = ("parse_known_args", "parse_args", "configured", "to_config")  # what mains read their command line with
    name = next((one for one in readers if f"{one}(" in code), None)
    if name is None:
        assert not words, f"{module} reads no command line"
        return None
    owner = argparse.ArgumentParser if name.startswith("parse") else inspect.getmodule(found)
    original = getattr(owner, name)

    def stop(*arguments, **named):
        result = original(*arguments, **named)
        raise Parsed(result)

    monkeypatch.setattr(owner, name, stop)
    monkeypatch.setattr(sys, "argv", [module, *words])
    try:
        found()
    except Parsed as parsed:
        rest = parsed.args[0][1] if name == "parse_known_args" else getattr(parsed.args[0], "overrides", [])
        return composed(rest) if rest else None
    finally:
        monkeypatch.setattr(owner, name, original)
    raise AssertionError(f"{command}: nothing was parsed")


def composed(words):
    """Compose and check the configurations that a command line of ``fdslam.run`` means.

    In a sweep every value of every key is in one of them, not every combination.
    """
    run.register()
    words = run.quote_paths([word for word in words if word != "-m"])
    each = [values(word) for word in words]
    jobs = [[one[min(i, len(one) - 1)] for one in each] for i in range(max(map(len, [[""], *each])))]
    with initialize_config_dir(str(CONF), version_base="1.3"):
        for job in jobs:
            found = compose("config", overrides=job, return_hydra_config=True)
            swept = found.hydra.sweeper.params or {}  # by an experiment: the first value of each key
            job += [values(f"{key}={several}")[0] for key, several in swept.items()]
            ours = [one for one in job if not re.match(r"hydra[./]", one)]
            config = run.to_config(compose("config", overrides=ours))
            assert overruled(config.mode, ours) is None, job


def values(word):
    """Return an override once for each value that it takes in a sweep."""
    (override,) = OverridesParser.create().parse_overrides([word])
    if not override.is_sweep_override():
        return [word]
    return [f"{override.get_key_element()}={value}" for value in override.sweep_string_iterator()]
