"""Islands of a weak list: neighbours along the path vouch for each other (§FD, refinement).

Two published rules, in our words. Both keep the images whose score, min–max normalised over the map, exceeds 0.3.
"ibow" (Garcia-Fidalgo & Ortiz 2018): visited by falling score, each falls into an island that is there, or opens one of
three images to either side, trimmed by the islands before it; an island's score is its sum over its length. "dloop"
(Gálvez-López & Tardós 2012): sorted along the path and cut where neighbours are three or more apart; an island's score
is its sum. Islands mean something only where map ids follow the path.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

REACH = 3  # images
Island = tuple[list[int], int]  # its kept images and its length


def islands(scores: NDArray[np.int64], rule: str) -> NDArray[np.int64]:
    """Return levels that order every list by its islands: larger is better, equal is a tie, 0 is never retrieved.

    Images of islands come first, by the island's score, then by their own; then the others by their own score. Nothing
    is rounded. A list that scores all images alike is left as it is.

    Args:
        scores: int64 [J, M], not negative.
        rule: "none", "ibow" or "dloop".

    Returns:
        int64 [J, M].
    """
    if rule == "none" or not scores.size:
        return scores
    return np.stack([_levels(row, rule) for row in scores])


def _levels(row: NDArray[np.int64], rule: str) -> NDArray[np.int64]:
    low, high = int(row.min()), int(row.max())
    if low == high:
        return row
    likely = np.flatnonzero((row - low) / (high - low) > 0.29)  # the exact sieve follows
    kept = [int(m) for m in likely if 10 * (int(row[m]) - low) > 3 * (high - low)]
    found = _opened(row, kept) if rule == "ibow" else _cut(kept)
    grade = {}
    for members, length in found:
        total = Fraction(sum(int(row[m]) - low for m in members), length)
        grade.update({m: (total, int(row[m])) for m in members})
    others = np.ones(len(row), bool)
    others[kept] = False
    levels = np.zeros(len(row), np.int64)
    retrieved = np.flatnonzero(others & (row > 0))
    distinct, place = np.unique(row[retrieved], return_inverse=True)
    levels[retrieved] = place + 1
    order = {value: i for i, value in enumerate(sorted(set(grade.values())), len(distinct) + 1)}
    for m, value in grade.items():
        levels[m] = order[value]
    return levels


def _opened(row: NDArray[np.int64], kept: list[int]) -> list[Island]:
    """Return the islands of rule "ibow"."""
    owner = np.full(len(row), -1, np.int64)
    found: list[Island] = []
    for m in sorted(kept, key=lambda m: (-int(row[m]), m)):
        if owner[m] >= 0:
            found[owner[m]][0].append(m)
            continue
        begin = end = m
        while begin > max(m - REACH, 0) and owner[begin - 1] < 0:
            begin -= 1
        while end < min(m + REACH, len(row) - 1) and owner[end + 1] < 0:
            end += 1
        owner[begin : end + 1] = len(found)
        found.append(([m], end + 1 - begin))
    return found


def _cut(kept: list[int]) -> list[Island]:
    """Return the islands of rule "dloop"; their length does not count."""
    found: list[Island] = []
    for m in kept:
        if found and m - found[-1][0][-1] < REACH:
            found[-1][0].append(m)
        else:
            found.append(([m], 1))
    return found
