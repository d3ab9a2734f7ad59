"""How a switch is declared: its meaning, its range, and the check when an object is made."""

from __future__ import annotations

import math
from dataclasses import field, fields
from typing import Any, ClassVar

from omegaconf import MISSING

from fdslam.errors import InputError


def option(
    default: Any,
    help: str,
    *,
    choices: tuple = (),
    low: float | None = None,
    high: float | None = None,
    empty: bool = False,
) -> Any:
    """Declare a field with its meaning and its range (``low <= value <= high`` or one of ``choices``).

    A list may be empty only where ``empty`` says so.
    """
    metadata = {"help": help, "choices": choices, "low": low, "high": high, "empty": empty}
    if isinstance(default, list):
        return field(default_factory=lambda: list(default), metadata=metadata)
    return field(default=default, metadata=metadata)


class Checked:
    """Checks every field's range when an object is made from the merged configuration."""

    group: ClassVar[str | None] = None  # how the command line names it, where that is not the class's own name

    def __post_init__(self) -> None:
        """Raise InputError, naming group and key, for the first value out of range."""
        for f in fields(self):  # type: ignore[arg-type]
            value, meta = getattr(self, f.name), f.metadata
            if isinstance(value, str) and value.lower() in meta.get("choices", ()):
                value = value.lower()  # Hydra reads true as a truth value, which comes back as "True"
                setattr(self, f.name, value)
            group = type(self).__name__.lower() if self.group is None else self.group
            where = f"{group}.{f.name}".lstrip(".")
            if value == [] and not meta.get("empty"):
                raise InputError(f"{where}=[]: name at least one")
            if isinstance(value, list) and len(set(value)) < len(value):
                raise InputError(f"{where}={value}: something is named twice")
            for item in value if isinstance(value, list) else [value]:
                if item == MISSING and isinstance(item, str):
                    continue
                if meta.get("choices") and item not in meta["choices"]:
                    raise InputError(f"{where}={item}: choose one of {', '.join(map(str, meta['choices']))}")
                low, high = meta.get("low"), meta.get("high")
                if isinstance(item, float) and not math.isfinite(item):
                    raise InputError(f"{where}={item}: a finite number is needed")
                if (low is not None and not item >= low) or (high is not None and not item <= high):
                    bounds = f"at least {low}" if high is None else f"{low} to {high}"
                    raise InputError(f"{where}={item}: out of range, it must be {bounds}")


def part(config: Any, base: type) -> dict[str, Any]:
    """Return the fields of ``config`` that ``base`` declares: what a stage's artefacts are addressed by."""
    return {f.name: getattr(config, f.name) for f in fields(base)}
