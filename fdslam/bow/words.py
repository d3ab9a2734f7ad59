"""The growing set of words and the search for the two nearest: exact while it is small, by lists around pivots after.

While there are fewer than ``exact_below`` words every query is compared with all of them. Then pivots are chosen
(pivots.py); every word belongs to the list of its nearest pivot, and a query is compared with the words in the lists of
its ``probes`` nearest pivots. Adding is an append to the lists. When there are twice the words that the pivots were
chosen from, more are chosen and all words go to their lists anew, so that lists stay short: over a map's life a word
does so about twice. A word equal to a query is always found: both have the same nearest pivot.

Lists are chains of blocks of 32 words in one pool. All queries are searched together, list by list, so that a list is
fetched once for all that want it; each query's result depends on that query and the words alone.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fdslam.bow import hamming
from fdslam.bow.hamming import GROUP, NONE, Keys
from fdslam.bow.pivots import Pivots
from fdslam.native import NATIVE, njit, say_what_is_slow

if NATIVE:
    from fdslam.bow.kernels import search_lists

PIVOT = "pivot_"  # before the names of the arrays of pivots
BLOCK = 32  # words in a block: 1 KB
GROWTH = 2  # pivots are chosen anew when there are so many times the words that there were
LOOSE = 1.1  # the pool is put in the order of the lists when it has grown by this since the last time


@njit
def _append(groups, ids, following, first, last, fill, used, words, lists, names):
    """Put words into lists, opening blocks from ``used`` on; return how many blocks are in use then."""
    for i in range(len(lists)):
        chain = lists[i]
        if last[chain] < 0 or fill[chain] == 32:
            if last[chain] < 0:
                first[chain] = used
            else:
                following[last[chain]] = used
            last[chain] = used
            fill[chain] = 0
            used += 1
        place = fill[chain]
        group = last[chain] * 4 + place // 8
        for part in range(4):
            groups[group * 32 + part * 8 + place % 8] = words[4 * i + part]
        ids[group * 8 + place % 8] = names[i]
        fill[chain] = place + 1
    return used


@njit
def _block_order(first, following, used):
    """Return the blocks list after list, int64 [used]."""
    order = np.empty(used, np.int64)
    place = 0
    for chain in range(len(first)):
        block = first[chain]
        while block >= 0:
            order[place] = block
            place += 1
            block = following[block]
    return order


@njit
def _by_list(probes, lists):
    """Return, list after list, which queries want it (int32), and where each list begins (int32 [lists + 1])."""
    count, width = probes.shape
    begins = np.zeros(lists + 1, np.int32)
    for i in range(count):
        for p in range(width):
            if probes[i, p] >= 0:
                begins[probes[i, p] + 1] += 1
    for chain in range(lists):
        begins[chain + 1] += begins[chain]
    queries = np.empty(begins[lists], np.int32)
    place = begins.copy()
    for i in range(count):
        for p in range(width):
            chain = probes[i, p]
            if chain >= 0:
                queries[place[chain]] = i
                place[chain] += 1
    return queries, begins


class Words:
    """Immutable 256-bit words that only ever grow in number; their ids are 0, 1, 2, … in the order of adding."""

    def __init__(self, exact_below: int, probes: int) -> None:
        """Start empty.

        Args:
            exact_below: the search is exact while there are fewer words than this.
            probes: lists searched per query after that: 8, 16, 32 or 64.
        """
        say_what_is_slow()
        self.exact_below, self.depth = exact_below, probes // GROUP
        self._count = 0
        self._pivots: Pivots | None = None
        self._places: NDArray[np.int64] | None = None  # of the words in the pool, made when they are asked for
        self._clear(1)

    def _clear(self, lists: int) -> None:
        self._groups = np.zeros(0, np.uint64)
        self._ids = np.zeros(0, np.int32)
        self._following = np.zeros(0, np.int32)
        self._used = self._tidy = 0
        self._first, self._last = np.full(lists, -1, np.int32), np.full(lists, -1, np.int32)
        self._fill = np.zeros(lists, np.int32)

    def __len__(self) -> int:
        return self._count

    @property
    def chosen_from(self) -> int:
        """How many words the pivots were chosen from; 0 while the search is exact."""
        return self._pivots.words if self._pivots else 0

    @property
    def nbytes(self) -> int:
        """Bytes of the words, their ids and lists, and of the room kept for more."""
        pivots = self._pivots.nbytes if self._pivots else 0
        pool = (self._groups, self._ids, self._following, self._first, self._last, self._fill)
        return pivots + sum(array.nbytes for array in pool)

    def descriptors(self) -> NDArray[np.uint8]:
        """Return all words in the order of their ids, uint8 [n, 32]."""
        groups, ids = self._in_use()
        words = np.empty((self._count, 32), np.uint8)
        words[ids[ids >= 0]] = hamming.unpack(groups)[ids >= 0]
        return words

    def rows(self, names: NDArray[np.integer]) -> NDArray[np.uint8]:
        """Return the words of these ids (int [n]), uint8 [n, 32]."""
        groups, ids = self._in_use()
        if self._places is None or len(self._places) != self._count:  # ids stay, but their places may have moved
            places = np.empty(self._count, np.int64)
            places[ids[ids >= 0]] = np.flatnonzero(ids >= 0)
            self._places = places
        group, lane = np.divmod(self._places[names], GROUP)
        return np.ascontiguousarray(groups.reshape(-1, 4, GROUP)[group, :, lane]).view(np.uint8)

    def _in_use(self) -> tuple[NDArray[np.uint64], NDArray[np.int32]]:
        """Return groups and ids of the blocks in use, without the room kept for more."""
        return self._groups[: self._used * BLOCK * 4], self._ids[: self._used * BLOCK]

    def arrays(self) -> dict[str, NDArray]:
        """Return everything that is kept, for storage; ``from_arrays`` takes it back.

        The arrays are those in use, not copies: store them before more words are added.
        """
        if self._pivots is not None:
            self._put_in_order()
        groups, ids = self._in_use()
        kept: dict[str, NDArray] = {"groups": groups, "ids": ids, "following": self._following[: self._used]}
        kept |= {"first": self._first, "last": self._last, "fill": self._fill}
        pivots = {} if self._pivots is None else self._pivots.arrays()
        return kept | {f"{PIVOT}{name}": array for name, array in pivots.items()}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray], exact_below: int, probes: int) -> Words:
        """Return words from what ``arrays`` gave; the large ones may be mapped privately and are not copied."""
        words = cls(exact_below, probes)
        words._groups, words._ids, words._following = arrays["groups"], arrays["ids"], arrays["following"]
        words._first, words._last, words._fill = (np.array(arrays[name]) for name in ("first", "last", "fill"))
        words._used = words._tidy = len(words._following)
        words._count = int((words._ids >= 0).sum())
        pivots = {name.removeprefix(PIVOT): array for name, array in arrays.items() if name.startswith(PIVOT)}
        words._pivots = Pivots.from_arrays(pivots) if pivots else None
        return words

    def append(self, words: NDArray[np.uint8], lists: NDArray[np.int64] | None = None) -> None:
        """Add words; their ids follow on.

        Args:
            words: uint8 [n, 32].
            lists: int64 [n], what ``search`` gave for them just now, if it did: they need not be searched for again.
        """
        limit, total = GROWTH * self._pivots.words if self._pivots else self.exact_below, self._count + len(words)
        if total >= limit:
            while total >= GROWTH * limit:
                limit *= GROWTH
            everything = np.concatenate([self.descriptors(), words])
            self._pivots = Pivots.choose(everything[:limit])  # whatever the steps in which the words came
            self._clear(len(self._pivots))
            self._count, words, lists = 0, everything, None
        for begin in range(0, len(words), 1 << 16):
            part = slice(begin, begin + (1 << 16))
            self._put(words[part], self._homes(words[part]) if lists is None else lists[part])
        if self._pivots is not None and self._used > LOOSE * self._tidy:
            self._put_in_order()

    def _put_in_order(self) -> None:
        """Lay the blocks of a list side by side: the search then reads memory in one direction."""
        self._places = None
        order = _block_order(self._first, self._following, self._used)
        place = np.full(self._used + 1, -1, np.int32)  # the last one stands for "no block", -1
        place[order] = np.arange(self._used, dtype=np.int32)
        self._groups, self._ids = (part.reshape(self._used, -1)[order].reshape(-1) for part in self._in_use())
        self._following = place[self._following[order]]
        self._first, self._last = place[self._first], place[self._last]
        self._tidy = self._used

    def _homes(self, words: NDArray[np.uint8]) -> NDArray[np.int64]:
        if self._pivots is None:
            return np.zeros(len(words), np.int64)
        return self._pivots.home(words)

    def _put(self, words: NDArray[np.uint8], lists: NDArray[np.int64]) -> None:
        self._reserve(self._used + self._new_blocks(lists))
        names = np.arange(self._count, self._count + len(words), dtype=np.int32)
        chains = (self._first, self._last, self._fill)
        self._used = _append(
            self._groups, self._ids, self._following, *chains, self._used, hamming.flat(words), lists, names
        )
        self._count += len(words)

    def _new_blocks(self, lists: NDArray[np.int64]) -> int:
        coming = np.bincount(lists, minlength=len(self._fill))
        room = np.where(self._last >= 0, BLOCK - self._fill, 0)
        return int(np.maximum(-(-(coming - room) // BLOCK), 0).sum())

    def _reserve(self, blocks: int) -> None:
        """Make room for so many blocks; grows by an eighth, so that adding costs the same however many there are."""
        have = len(self._following)
        if blocks <= have:
            return
        more = max(blocks, have + have // 8) - have
        self._groups = np.concatenate([self._groups, np.zeros(more * BLOCK * 4, np.uint64)])
        self._ids = np.concatenate([self._ids, np.full(more * BLOCK, -1, np.int32)])
        self._following = np.concatenate([self._following, np.full(more, -1, np.int32)])

    def two_nearest(self, queries: NDArray[np.uint8]) -> Keys:
        """Return the keys ``distance << 32 | id`` of the two nearest words found, uint64 [n, 2]; NONE for no word."""
        return self.search(queries)[0]

    def search(
        self, queries: NDArray[np.uint8], leave: NDArray[np.int32] | None = None
    ) -> tuple[Keys, NDArray[np.int64]]:
        """Return the keys of the two nearest words found, and the list each query would join as a word, int64 [n].

        ``leave`` (int32 [n, 2]) gives each query a half-open interval of ids that are passed over.
        """
        if self._count == 0 or len(queries) == 0:
            return np.full((len(queries), 2), NONE), np.zeros(len(queries), np.int64)
        if self._pivots is None:
            keys = hamming.two_nearest_keys(*self._in_use(), queries, leave)
            return keys, np.zeros(len(queries), np.int64)
        nearest = self._pivots.nearest(queries, self.depth)
        probes = hamming.id_of(nearest).reshape(len(queries), -1).astype(np.int32)
        homes = hamming.id_of(nearest[:, 0].min(axis=1))
        wanting, begins = _by_list(probes, len(self._first))
        if not NATIVE:
            return self._search_slowly(queries, leave, wanting, begins), homes
        out = np.full((len(queries), 2), NONE)
        pool = (self._groups, self._ids, self._following, self._first, self._last, self._fill)
        search_lists(*pool, hamming.flat(queries), leave, wanting, begins, out.reshape(-1))
        return out, homes

    def _search_slowly(
        self, queries: NDArray[np.uint8], leave: NDArray[np.int32] | None, wanting: NDArray, begins: NDArray
    ) -> Keys:
        best = np.full((len(queries), 2), NONE)
        for chain in np.flatnonzero(np.diff(begins)):
            who, block = wanting[begins[chain] : begins[chain + 1]], self._first[chain]
            while block >= 0:
                words = hamming.unpack(self._groups[block * BLOCK * 4 : (block + 1) * BLOCK * 4])
                ids = self._ids[block * BLOCK : (block + 1) * BLOCK]
                found = hamming.keys_of(hamming.distances(queries[who], words), ids)
                found = hamming.without(found, None if leave is None else leave[who])
                best[who] = hamming.two_smallest(np.concatenate([best[who], found], axis=1))
                block = self._following[block]
        return best
