"""The incremental vocabulary: immutable 256-bit words that grow with the map (§FD; Garcia-Fidalgo & Ortiz 2018).

For each map image in turn every descriptor is matched to its two nearest words; it is that word if d1 ≤ ratio · d2,
otherwise it becomes a new word. What an image adds depends on the images before it alone, so a longer map reuses all
that a shorter one has done.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from fdslam.bow.hamming import Keys, distance_of, id_of
from fdslam.bow.words import Words

NO_WORD = -1


class Vocabulary:
    """The words so far, and the ratio test of the two nearest."""

    def __init__(self, ratio: float, exact_below: int = 100_000, probes: int = 32) -> None:
        """Start empty; ``exact_below`` and ``probes`` are those of ``Words``."""
        self.ratio = ratio
        self.words = Words(exact_below, probes)

    def __len__(self) -> int:
        return len(self.words)

    def match(self, descriptors: NDArray[np.uint8]) -> NDArray[np.int32]:
        """Return the word of each descriptor (uint8 [n, 32]) as int32 [n], NO_WORD where the ratio test fails.

        With fewer than two words there is no second nearest, so the test cannot be passed. Two words are never equal,
        and of equally near ones the older is the nearest.
        """
        return self._tested(self.words.two_nearest(descriptors))

    def _tested(self, keys: Keys) -> NDArray[np.int32]:
        nearest, second = distance_of(keys).T
        word = id_of(keys)
        accepted = (word[:, 1] >= 0) & (nearest <= self.ratio * second)
        return np.where(accepted, word[:, 0], NO_WORD).astype(np.int32)

    def append(self, words: NDArray[np.uint8]) -> None:
        """Add new words (uint8 [n, 32]); their ids follow on."""
        self.words.append(words)

    def learn(self, descriptors: NDArray[np.uint8]) -> NDArray[np.int32]:
        """Post one map image: return the word of every descriptor as int32 [n], adding the new words.

        Equal descriptors of one image are one word, so no two words are ever equal.
        """
        keys, lists = self.words.search(descriptors)
        words = self._tested(keys)
        new = np.flatnonzero(words == NO_WORD)
        if len(new):
            first, inverse = distinct_rows(descriptors[new])
            words[new] = len(self) + inverse
            self.words.append(descriptors[new[first]], lists[new[first]])
        return words


def distinct_rows(rows: NDArray[np.uint8]) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Return where the distinct rows (uint8 [n, 32]) appear first, in that order, and for each row which it is."""
    quarters = np.ascontiguousarray(rows).view(np.uint64)
    order = np.lexsort(quarters.T)
    rising = quarters[order]
    starts = np.concatenate([[True], (rising[1:] != rising[:-1]).any(axis=1)])
    first = np.minimum.reduceat(order, np.flatnonzero(starts))
    place = np.empty(len(first), np.int32)
    place[np.argsort(first)] = np.arange(len(first), dtype=np.int32)
    inverse = np.empty(len(rows), np.int32)
    inverse[order] = place[np.cumsum(starts) - 1]
    return np.sort(first), inverse


def replay(vocabulary: Vocabulary, images: Iterable[tuple[NDArray[np.uint8], NDArray[np.int32]]]) -> Iterator[None]:
    """Rebuild a vocabulary from (descriptors, words) of its map images, one image a step, without any search."""
    for descriptors, words in images:
        new = words >= len(vocabulary)
        _, first = np.unique(words[new], return_index=True)
        vocabulary.append(descriptors[new][first])
        yield
