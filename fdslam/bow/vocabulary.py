"""The incremental vocabulary: immutable 256-bit words that grow with the map (§FD; Garcia-Fidalgo & Ortiz 2018).

For each map image in turn every descriptor is matched to its two nearest words; it is that word if d1 ≤ ratio · d2,
otherwise it becomes a new word. What an image adds depends on the images before it alone, so a longer map reuses all
that a shorter one has done.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import faiss
import numpy as np
from numpy.typing import NDArray

BITS = 256
NO_WORD = -1


class Vocabulary:
    """The words so far, with exact search by Hamming distance."""

    def __init__(self, ratio: float) -> None:
        self.ratio = ratio
        self._index = faiss.IndexBinaryFlat(BITS)

    def __len__(self) -> int:
        return self._index.ntotal

    def match(self, descriptors: NDArray[np.uint8]) -> NDArray[np.int32]:
        """Return the word of each descriptor (uint8 [n, 32]) as int32 [n], NO_WORD where the ratio test fails.

        With fewer than two words there is no second nearest, so the test cannot be passed. Equal nearest distances
        above 0 fail the test, and two words are never equal: the answer never hangs on the order of the search.
        """
        if len(self) < 2 or len(descriptors) == 0:
            return np.full(len(descriptors), NO_WORD, np.int32)
        distance, word = self._index.search(np.ascontiguousarray(descriptors), 2)
        accepted = distance[:, 0] <= self.ratio * distance[:, 1]
        return np.where(accepted, word[:, 0], NO_WORD).astype(np.int32)

    def append(self, words: NDArray[np.uint8]) -> None:
        """Add new words (uint8 [n, 32]); their ids follow on."""
        if len(words):
            self._index.add(np.ascontiguousarray(words))

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
