"""Pivots around which the words lie, and the search for the nearest of them, in two levels.

Pivots are drawn from the words with a fixed seed and moved twice to the majority of the bits around them. They lie
around hubs, chosen from the pivots in the same way; a query is compared with all hubs and then with the pivots of the
nearest 32. There is one pivot for every 256 words and a number of hubs that grows with the root of that, so that the
cost of finding pivots grows slowly. What is found depends on the query and the pivots alone: equal queries find the
same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.bow import hamming
from fdslam.bow.hamming import GROUP, NONE, Keys
from fdslam.native import NATIVE

if NATIVE:
    from fdslam.bow.kernels import count_ones, nearest_pivots_kernel

WORDS_PER_PIVOT = 256
SAMPLE = 32  # words per pivot that are looked at when pivots are moved
ROUNDS = 2  # of moving: more gain nothing
HUB_DEPTH = 4  # hubs visited, for each of the eight places of a group; kernels.py has it too
SEED = 0
Nearest = Callable[[NDArray[np.uint8], NDArray[np.uint8]], NDArray[np.int64]]  # centres, rows -> the centre of each row


@dataclass(frozen=True)
class Pivots:
    """P pivots, hub after hub, those of a hub filled up to whole groups."""

    hubs: NDArray[np.uint64]  # [g · 32] groups
    hub_ids: NDArray[np.int32]  # [g · 8]
    groups: NDArray[np.uint64]  # [G · 32] pivots
    ids: NDArray[np.int32]  # [G · 8] 0 … P-1, else -1
    begins: NDArray[np.int32]  # [hubs + 1] the first group of each hub
    words: int  # how many there were when the pivots were chosen

    def __len__(self) -> int:
        """Return P."""
        return int(np.count_nonzero(self.ids >= 0))

    @property
    def nbytes(self) -> int:
        """Bytes of all it holds."""
        return sum(array.nbytes for array in self.arrays().values())

    def arrays(self) -> dict[str, NDArray]:
        """Return everything that is kept, for storage; ``from_arrays`` takes it back."""
        kept = {name: getattr(self, name) for name in ("hubs", "hub_ids", "groups", "ids", "begins")}
        return kept | {"words": np.array([self.words])}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray]) -> Pivots:
        """Return pivots from what ``arrays`` gave; they may be mapped and are not copied."""
        return cls(**{name: array for name, array in arrays.items() if name != "words"}, words=int(arrays["words"][0]))

    @classmethod
    def around(cls, pivots: NDArray[np.uint8], words: int) -> Pivots:
        """Return pivots (uint8 [P, 32]) around hubs chosen from them."""
        count = min(GROUP * int(np.ceil(2 * np.sqrt(len(pivots)) / GROUP)), len(pivots))
        rng = np.random.default_rng(SEED)
        chosen = _moved(pivots[np.sort(rng.choice(len(pivots), count, replace=False))], pivots, _nearest_of_all)
        hub = _nearest_of_all(chosen, pivots)
        order = np.argsort(hub, kind="stable").astype(np.int32)
        size = np.bincount(hub, minlength=count)
        groups = -(-size // GROUP)
        begins = np.concatenate([[0], np.cumsum(groups)]).astype(np.int32)
        place = np.arange(len(order)) + np.repeat(begins[:-1] * GROUP - (np.cumsum(size) - size), size)
        names, rows = np.full(begins[-1] * GROUP, -1, np.int32), np.zeros((begins[-1] * GROUP, 32), np.uint8)
        names[place], rows[place] = order, pivots[order]
        return cls(*hamming.pack(chosen), hamming.pack(rows)[0], names, begins, words)

    @classmethod
    def choose(cls, words: NDArray[np.uint8]) -> Pivots:
        """Return pivots for these words (uint8 [n, 32])."""
        rng = np.random.default_rng(SEED)
        count = max(len(words) // WORDS_PER_PIVOT, 1)
        pivots = words[np.sort(rng.choice(len(words), count, replace=False))]
        sample = words[np.sort(rng.choice(len(words), min(SAMPLE * count, len(words)), replace=False))]

        def nearest(pivots: NDArray[np.uint8], sample: NDArray[np.uint8]) -> NDArray[np.int64]:
            return cls.around(pivots, len(words)).home(sample)

        return cls.around(_moved(pivots, sample, nearest), len(words))

    def nearest(self, queries: NDArray[np.uint8], depth: int) -> Keys:
        """Return the keys of the ``depth`` nearest pivots in each of the eight places of a group.

        That is nearly the 8 · depth nearest, without a selection: random descriptors do not crowd in one place.

        Args:
            queries: uint8 [n, 32].
            depth: 1, 2, 4 or 8.

        Returns:
            uint64 [n, depth, 8] ``distance << 32 | id``, rising along the second axis; NONE where a place has fewer.
        """
        if NATIVE:
            out = np.empty((len(queries), depth, GROUP), np.uint64)
            pivots = (self.hubs, self.hub_ids, self.groups, self.ids, self.begins)
            nearest_pivots_kernel(*pivots, hamming.flat(queries), depth, out.reshape(-1))
            return out
        hubs = hamming.keys_of(hamming.distances(queries, hamming.unpack(self.hubs)), self.hub_ids)
        visited = hamming.id_of(_per_place(hubs, HUB_DEPTH)).reshape(len(queries), -1)
        best = np.full((len(queries), depth, GROUP), NONE)
        rows = hamming.unpack(self.groups)
        for hub, (begin, end) in enumerate(zip(self.begins[:-1], self.begins[1:], strict=True)):
            who, part = np.flatnonzero((visited == hub).any(axis=1)), slice(begin * GROUP, end * GROUP)
            found = hamming.keys_of(hamming.distances(queries[who], rows[part]), self.ids[part])
            best[who] = _per_place(np.concatenate([best[who].reshape(len(who), depth * GROUP), found], axis=1), depth)
        return best

    def home(self, words: NDArray[np.uint8]) -> NDArray[np.int64]:
        """Return the nearest pivot of each word (uint8 [n, 32]) among those that ``nearest`` sees, int64 [n]."""
        return hamming.id_of(self.nearest(words, 1).min(axis=(1, 2)))


def _per_place(keys: Keys, depth: int) -> Keys:
    """Return the ``depth`` smallest keys in each of the eight places: uint64 [n, g · 8] to [n, depth, 8]."""
    filled = np.concatenate([keys, np.full((len(keys), depth * GROUP), NONE)], axis=1)
    return np.sort(filled.reshape(len(keys), filled.shape[1] // GROUP, GROUP), axis=1)[:, :depth]


def _nearest_of_all(centres: NDArray[np.uint8], rows: NDArray[np.uint8]) -> NDArray[np.int64]:
    return hamming.id_of(hamming.two_nearest_keys(*hamming.pack(centres), rows)[:, 0])


def _moved(centres: NDArray[np.uint8], rows: NDArray[np.uint8], nearest: Nearest) -> NDArray[np.uint8]:
    """Move each centre to the majority of every bit among the rows nearest to it, ROUNDS times.

    A bit keeps its value where there is no majority.
    """
    for _ in range(ROUNDS):
        mine = nearest(centres, rows)
        members = np.bincount(mine, minlength=len(centres))[:, None]
        ones, old = _ones(rows, mine, len(centres)), np.unpackbits(centres, axis=1)
        centres = np.packbits(np.where(2 * ones == members, old, 2 * ones > members), axis=1)
    return centres


def _ones(rows: NDArray[np.uint8], mine: NDArray[np.int64], count: int) -> NDArray[np.int32]:
    """Return how often each bit is set among the rows of each centre, int32 [count, 256]."""
    ones = np.zeros((count, 256), np.int32)
    if NATIVE:
        count_ones(rows, mine, ones)
    else:
        np.add.at(ones, mine, np.unpackbits(rows, axis=1))
    return ones
