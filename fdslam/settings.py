"""Settings of the library and its command: words KEY=VALUE, and what a live image cannot have."""

from __future__ import annotations

from collections.abc import Iterable

from fdslam.config import Config
from fdslam.errors import InputError

# What has an argument of its own: given among the settings it would be overruled without a word.
ARGUMENTS = {"mode": "mode", "mix": "detectors", "mix.rows": "detectors", "detectors": "detectors", "store": "store"}


def as_words(settings: Iterable[str]) -> dict[str, str]:
    """Return settings as a dict from key to value.

    Raises:
        InputError: a word that is not KEY=VALUE, or a key that has an argument of its own or no meaning here.
    """
    if isinstance(settings, str):
        raise InputError(f"settings: {settings!r} is one text; give a list of them, [{settings!r}]")
    words = {}
    for word in settings:
        key, equals, value = word.partition("=")
        if not equals:
            raise InputError(f"settings: {word!r} is not KEY=VALUE")
        key = key.strip()
        if key in ARGUMENTS:
            name = ARGUMENTS[key]
            raise InputError(f"settings: {key} is no setting here; give {name}=… itself, --{name} on the command line")
        if key.partition(".")[0] == "dataset":
            raise InputError(f"settings: {key} is no setting here; the images are those that are given")
        words[key] = value
    return words


def check_live(config: Config) -> None:
    """Raise InputError if a configuration wants of a live image what only a data set can have."""
    if config.evaluation.viewpoint != "predicted":
        raise InputError(
            f"evaluation.viewpoint={config.evaluation.viewpoint}: of a live image the true place is not known; "
            "leave it predicted"
        )
    if config.mask.source == "labels":
        raise InputError("mask=labels: a live image has no label image; choose mask=deeplabv3plus or mask=none")
