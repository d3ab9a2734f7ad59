"""The incremental vocabulary: immutable 256-bit words that grow with the map (§FD; Garcia-Fidalgo & Ortiz 2018).

For each map image in turn every descriptor is matched to its two nearest words; it is that word if d1 ≤ ratio · d2,
otherwise it becomes a new word. What an image adds depends on the images before it alone, so a longer map reuses all
that a shorter one has done.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from fdslam.bow.hamming import distance_of, id_of
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
        keys = self.words.two_nearest(descriptors)
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
        words = self.match(descriptors)
        new = words == NO_WORD
        if new.any():
            unknown, inverse = unique_rows(descriptors[new])
            words[new] = len(self) + inverse
            self.append(unknown)
        return words


def unique_rows(rows: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
    """Return the distinct rows in order of first appearance, and for each row the index of its like."""
    _, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    place = np.empty(len(order), np.int32)
    place[order] = np.arange(len(order), dtype=np.int32)
    return rows[np.sort(first)], place[inverse.reshape(-1)]


def replay(vocabulary: Vocabulary, images: Iterable[tuple[NDArray[np.uint8], NDArray[np.int32]]]) -> Iterator[None]:
    """Rebuild a vocabulary from (descriptors, words) of its map images, one image a step, without any search."""
    for descriptors, words in images:
        new = words >= len(vocabulary)
        _, first = np.unique(words[new], return_index=True)
        vocabulary.append(descriptors[new][first])
        yield
