"""Modes are named sets of switches, each a file in ``conf/mode``; here is what a configuration makes of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from fdslam.config import Config

_PACKED, _CHECKOUT = Path(__file__).parent / "conf", Path(__file__).parent.parent / "conf"
CONF = _PACKED if _PACKED.is_dir() else _CHECKOUT  # in a wheel, or in a checkout


def deviations(config: Config) -> dict[str, Any]:
    """Return the keys, and their values, in which a configuration is not what its mode says."""
    mode = OmegaConf.to_container(OmegaConf.load(CONF / "mode" / f"{config.mode}.yaml"))
    assert isinstance(mode, dict)
    found = {}
    for group, switches in mode.items():
        for key, value in switches.items() if isinstance(switches, dict) else ():
            ours = getattr(getattr(config, str(group)), str(key))
            if ours != value:
                found[".".join((str(group), str(key)))] = ours
    return found
