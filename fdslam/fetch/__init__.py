"""Downloads of what fdslam does not ship: a plain dict from a name to what fetches it.

Each entry says what it is, which options it takes and how it is fetched: ``python -m fdslam.fetch NAME``.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from fdslam.fetch import models, nclt
from fdslam.fetch.registry import MODELS


@dataclass(frozen=True)
class Fetcher:
    """Something that can be fetched."""

    summary: str
    arguments: Callable[[argparse.ArgumentParser], None]  # adds the options
    fetch: Callable[[argparse.Namespace], None]  # raises InputError in one line, with the way out


FETCHERS: dict[str, Fetcher] = {
    "nclt": Fetcher(nclt.SUMMARY, nclt.arguments, nclt.fetch),
    **{name: Fetcher(one.summary, models.arguments, partial(models.fetch, name)) for name, one in MODELS.items()},
}
