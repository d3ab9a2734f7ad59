"""Modes are named sets of switches, each a file in ``conf/mode``; here is what a configuration makes of its own."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from fdslam.config import Config

_PACKED, _CHECKOUT = Path(__file__).parent / "conf", Path(__file__).parent.parent / "conf"
CONF = _PACKED if _PACKED.is_dir() else _CHECKOUT  # in a wheel, or in a checkout


def _values(path: Path) -> dict[str, Any]:
    """Return what a configuration file holds."""
    found = OmegaConf.to_container(OmegaConf.load(path))
    assert isinstance(found, dict)
    return {str(key): value for key, value in found.items()}


def overruled(mode: str, overrides: Iterable[str]) -> str | None:
    """Return the first switch that a group chosen on the command line sets otherwise than the mode, as one line.

    A mode comes after the groups, so such a choice would have no effect.

    Args:
        mode: in use.
        overrides: of the command line, as ``pc=gaussian`` or ``pc.spread=gaussian``.
    """
    given = dict(override.partition("=")[::2] for override in overrides)
    switches = _values(CONF / "mode" / f"{mode}.yaml")
    for group, option in given.items():
        path = CONF / group / f"{option}.yaml"
        if group == "mode" or group not in switches or not path.is_file():
            continue
        for key, value in _values(path).items():
            theirs = switches[group].get(key, value)
            if theirs != value and f"{group}.{key}" not in given:
                return (
                    f"{group}={option} sets {group}.{key}={value}, but mode={mode} sets {theirs}; "
                    f"write {group}.{key}={value} to have it all the same"
                )
    return None


def deviations(config: Config) -> dict[str, Any]:
    """Return the keys, and their values, in which a configuration is not what its mode says."""
    mode = _values(CONF / "mode" / f"{config.mode}.yaml")
    found = {}
    for group, switches in mode.items():
        for key, value in switches.items() if isinstance(switches, dict) else ():
            ours = getattr(getattr(config, str(group)), str(key))
            if ours != value:
                found[".".join((str(group), str(key)))] = ours
    return found
