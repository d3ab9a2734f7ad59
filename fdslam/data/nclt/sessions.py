"""Which sessions of NCLT are meant: dates, or the paper's names of the seasons."""

from __future__ import annotations

import datetime
from collections.abc import Sequence

from fdslam.errors import InputError

SEASONS = {"WI": "2012-01-22", "SP": "2012-03-31", "SU": "2012-08-04", "AU": "2012-11-17"}  # §Settings
_LABELS = {date: season for season, date in SEASONS.items()}


def session_date(name: str, key: str = "dataset.sessions") -> str:
    """Return the date YYYY-MM-DD of a session given by date or season.

    Raises:
        InputError: neither of them; ``key`` is what the line blames.
    """
    date = SEASONS.get(name.upper(), name)
    try:
        fine = datetime.date.fromisoformat(date).isoformat() == date
    except ValueError:
        fine = False
    if not fine:
        raise InputError(f"{key}={name}: no session; give a date as 2012-01-22, or {', '.join(SEASONS)}")
    return date


def session_label(date: str) -> str:
    """Return how a session is shown: its season if it is one of the paper's four, else its date."""
    return _LABELS.get(date, date)


def session_pairs(query: str, map: str, sessions: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Return the ordered (query, map) pairs of dates; ``all`` stands for every one of ``sessions``.

    Raises:
        InputError: an unknown name, or no pair of two different sessions.
    """
    everything = list(dict.fromkeys(session_date(name) for name in sessions))
    queries = everything if query == "all" else [session_date(query, "dataset.query")]
    maps = everything if map == "all" else [session_date(map, "dataset.map")]
    pairs = tuple((q, m) for q in queries for m in maps if q != m)
    if not pairs:
        raise InputError(
            f"dataset.query={query} dataset.map={map}: no pair of two different sessions; choose another of either"
        )
    return pairs
