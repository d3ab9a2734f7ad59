"""A configuration from words of the command line, and what is wrong with them in one line."""

from __future__ import annotations

import difflib
import re
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass

import hydra
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import MissingMandatoryValue, OmegaConfBaseException

from fdslam.config import DATASETS, Checked, Config, register
from fdslam.errors import InputError
from fdslam.modes import CONF, overruled

FOLDERS = (
    "dataset.root",
    "dataset.annotations",
    "obb.yolo.weights",
    "obb.bing.filters",
    "compact.weights",
    "mask.weights",
    "store",
    "tracker.folder",
    "hydra.run.dir",
    "hydra.sweep.dir",
)  # keys whose values are folders or files


_composing = threading.Lock()  # Hydra has one state for the whole program


@contextmanager
def _hydra() -> Iterator[None]:
    """Use Hydra with our configuration; a program that is itself run by Hydra has its own back afterwards."""
    with _composing:
        theirs = GlobalHydra.instance().hydra
        GlobalHydra.instance().clear()
        try:
            register()
            with hydra.initialize_config_dir(str(CONF.resolve()), version_base="1.3"):
                yield
        finally:
            GlobalHydra.instance().clear()
            if theirs is not None:
                GlobalHydra.instance().initialize(theirs)


def configured(words: Sequence[str]) -> Config:
    """Return the configuration that words of the command line name, e.g. ``["mode=best", "obb=j_b"]``.

    Threads, and programs that are run by Hydra themselves, may call it.

    Raises:
        InputError: a word that is not understood, or one that the mode overrules.
    """
    with _hydra():
        try:
            config = to_config(hydra.compose("config", quote_paths(list(words))))
        except (HydraException, OmegaConfBaseException) as error:
            raise InputError(one_line(error)) from None
    if line := overruled(config.mode, words):
        raise InputError(line)
    return config


def to_config(composed: DictConfig) -> Config:
    """Return the composed configuration as checked dataclasses.

    Raises:
        InputError: an unknown key (``+key=value`` would add it silently), a missing value or one out of range.
    """
    try:
        config = OmegaConf.to_object(composed)
    except MissingMandatoryValue as error:
        key = str(error.full_key or "").strip() or str(error)
        raise InputError(f"{key} is missing: give {key}=… on the command line") from None
    assert isinstance(config, Config)
    for group in _groups(config):
        for key in vars(group).keys() - {f.name for f in fields(group)}:  # type: ignore[arg-type]
            name = type(group).__name__.lower() if group.group is None else group.group
            raise InputError(unknown_key(f"{name}.{key}".lstrip(".")))
    return config


def _groups(config: Checked) -> list[Checked]:
    inner = [value for value in vars(config).values() if isinstance(value, Checked)]
    return [config, *(group for one in inner for group in _groups(one))]


def unknown_key(key: str) -> str:
    """Return the line for a key that does not exist, with the nearest that do."""
    keys = known_keys()
    near = difflib.get_close_matches(key, keys, n=3) or [k for k in keys if k.split(".")[0] == key.split(".")[0]][:8]
    hint = f"; near: {', '.join(near)}" if near else ""
    return f"unknown key {key!r}{hint}; all keys: python -m fdslam.run --help"


def known_keys() -> list[str]:
    """Return every key of the schema, groups joined by dots."""

    def walk(schema: type, prefix: str) -> list[str]:
        found = []
        for field in fields(schema):
            inner = field.default_factory
            if isinstance(inner, type) and is_dataclass(inner):
                found += walk(inner, f"{prefix}{field.name}.")
            else:
                found.append(f"{prefix}{field.name}")
        return found

    data = [key for kind in DATASETS for key in walk(kind, "dataset.")]
    return list(dict.fromkeys([*walk(Config, ""), *data]))


def one_line(error: Exception) -> str:
    """Return in one line what Hydra and OmegaConf spread over several."""
    cause = error.__cause__
    text = " ".join(str(error).split())
    reason = str(cause).splitlines()[0] if cause is not None and str(cause) else ""
    unknown = re.search(r"Could not override '([^']*)'", text)
    if unknown and re.search(r"not in struct|Key '.*' not in", f"{text} {reason}"):
        return unknown_key(unknown[1].lstrip("+"))
    if option := re.search(
        r"Could not find '([^/']+)/([^']+)' Available options in '[^']+': (.*?) Config search", text
    ):
        choices = ", ".join(name for name in option[3].split() if not name.startswith("base_"))
        return f"{option[1]}={option[2]}: no such option, choose one of {choices}"
    if merging := re.search(r"Error merging override (.*)", text):
        return f"{merging[1]}: {reason or 'not possible'}"
    text = re.sub(r"\s*See https://\S+.*", "", text)
    return (
        f"{text}; write KEY=VALUE, see python -m fdslam.run --help" if "override" in text or "input" in text else text
    )


def quote_paths(arguments: list[str]) -> list[str]:
    """Return the arguments with folders and files quoted, so that any path the file system has is one value to Hydra.

    Left alone are paths in quotes already and, in a sweep, lists of them.
    """
    sweep = any(argument in ("-m", "--multirun") for argument in arguments)

    def quote(argument: str) -> str:
        key, _, path = argument.partition("=")
        if key not in FOLDERS or not path or path[0] in "'\"" or (sweep and "," in path):
            return argument
        escaped = path.replace("'", "\\'")
        return f"{key}='{escaped}'"

    return [quote(argument) for argument in arguments]
