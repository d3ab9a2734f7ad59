"""The incremental vocabulary: immutable 256-bit words that grow with the map (§FD; Garcia-Fidalgo & Ortiz 2018).

For each map image in turn every descriptor is matched to its two nearest words; it is that word if d1 ≤ ratio · d2,
otherwise it becomes a new word. What an image adds depends on the images before it alone, so a longer map reuses all
that a shorter one has done.

A place that was stored twice, as different words, fails this test ever after, as the two compete. ``second =
"other_place"`` takes for d2 the nearest word from another place: one that was not born within NEAR map images of the
nearest word's birth; as long as there is none, the test is the plain one. With ``purge`` a word seen fewer than SEEN
times by the time that WAIT images have followed the one it was born in is dropped: it will hardly be seen again.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam import config
from fdslam.bow import hamming
from fdslam.bow.hamming import NONE, Keys, distance_of, id_of
from fdslam.bow.words import Words

NO_WORD = -1
NEAR = 3  # map images: nearer ones along the path show the same place
WAIT, SEEN = 2, 2  # images a new word is given, and how often it must have been seen by then


@dataclass
class _Young:
    """The words of one image that may still be dropped."""

    descriptors: NDArray[np.uint8]  # [n, 32]
    begin: int  # id of the first; the others follow
    seen: NDArray[np.int64]  # [n] postings so far

    @property
    def names(self) -> NDArray[np.int32]:
        return np.arange(self.begin, self.begin + len(self.seen), dtype=np.int32)


class Vocabulary:
    """The words so far, and the ratio test of the two nearest."""

    def __init__(self, switches: config.Vocabulary) -> None:
        """Start empty."""
        self.switches = switches
        self.words = Words(switches.exact_below, switches.probes)
        self._ends: list[int] = []  # after each map image, how many ids were given
        self._young: list[_Young] = []
        self._names = np.zeros(0, np.int32)  # with purge: the id of each of ``words``, rising; there are gaps

    def __len__(self) -> int:
        """Return how many ids were given, those of dropped words included."""
        return self._ends[-1] if self._ends else 0

    @property
    def nbytes(self) -> int:
        """Bytes of all it holds."""
        young = sum(one.descriptors.nbytes + one.seen.nbytes for one in self._young)
        return self.words.nbytes + self._names.nbytes + 8 * len(self._ends) + young

    def match(self, descriptors: NDArray[np.uint8], leave: tuple[int, int] | None = None) -> NDArray[np.int32]:
        """Return the word of each descriptor (uint8 [n, 32]) as int32 [n], NO_WORD where the ratio test fails.

        Without a word that could be the second nearest the test cannot be passed. Of equally near words the older is
        the nearest. The words of ``leave``, a half-open interval of ids, are passed over; d2 is then that of the second
        nearest.
        """
        if leave is not None:
            keys, _ = self._search(descriptors, np.tile(np.array(leave, np.int32), (len(descriptors), 1)))
            return self._accepted(keys, keys[:, 1])
        return self._match(descriptors)[0]

    def born(self, image: int) -> tuple[int, int]:
        """Return the ids that a map image's new words were given, a half-open interval."""
        return (self._ends[image - 1] if image else 0), self._ends[image]

    def _match(self, descriptors: NDArray[np.uint8]) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
        """Return the words, and the list each descriptor would join as a word."""
        keys, lists = self._search(descriptors)
        word = id_of(keys)
        rival = keys[:, 1]
        if self.switches.second == "other_place":
            elsewhere = self._search(descriptors, self._place_of(word[:, 0]))[0][:, 0]
            rival = np.where(elsewhere == NONE, rival, elsewhere)
        return self._accepted(keys, rival), lists

    def _accepted(self, keys: Keys, rival: Keys) -> NDArray[np.int32]:
        """Return the nearest words where they pass the ratio test against rivals (keys [n]), else NO_WORD."""
        accepted = (id_of(rival) >= 0) & (distance_of(keys[:, 0]) <= self.switches.ratio * distance_of(rival))
        return np.where(accepted, id_of(keys)[:, 0], NO_WORD).astype(np.int32)

    def _place_of(self, word: NDArray[np.int64]) -> NDArray[np.int32]:
        """Return the ids born within NEAR images of each word's birth as half-open intervals, int32 [n, 2]."""
        ends = np.concatenate([[0], np.array(self._ends, np.int64)])  # image b bore ends[b] … ends[b + 1] - 1
        born = np.searchsorted(ends, word, side="right") - 1
        first, last = np.maximum(born - NEAR, 0), np.minimum(born + NEAR + 1, len(ends) - 1)
        return ends[np.stack([first, last], axis=1)].astype(np.int32)

    def _search(
        self, descriptors: NDArray[np.uint8], leave: NDArray[np.int32] | None = None
    ) -> tuple[Keys, NDArray[np.int64]]:
        """Search the words and those that may still be dropped; ids as they were given."""
        if not self.switches.purge:
            return self.words.search(descriptors, leave)
        place = None if leave is None else np.searchsorted(self._names, leave).astype(np.int32)
        keys, lists = self.words.search(descriptors, place)
        known = id_of(keys) >= 0
        names = self._names[id_of(keys)[known]].astype(np.uint64)
        keys[known] = (keys[known] >> np.uint64(32) << np.uint64(32)) | names
        if self._young:
            rows = np.concatenate([one.descriptors for one in self._young])
            young = hamming.pack(rows, np.concatenate([one.names for one in self._young]))
            found = hamming.two_nearest_keys(*young, descriptors, leave)
            keys = hamming.two_smallest(np.concatenate([keys, found], axis=1))
        return keys, lists

    def append(self, words: NDArray[np.uint8]) -> None:
        """Add one image's new words (uint8 [n, 32]); their ids follow on."""
        self.post(words, np.arange(len(self), len(self) + len(words), dtype=np.int32))

    def learn(self, descriptors: NDArray[np.uint8]) -> NDArray[np.int32]:
        """Post one map image: return the word of every descriptor as int32 [n], adding the new words.

        Equal descriptors of one image are one word.
        """
        words, lists = self._match(descriptors)
        new = np.flatnonzero(words == NO_WORD)
        if len(new):
            words[new] = len(self) + distinct_rows(descriptors[new])[1]
        self.post(descriptors, words, lists)
        return words

    def post(
        self, descriptors: NDArray[np.uint8], words: NDArray[np.int32], lists: NDArray[np.int64] | None = None
    ) -> None:
        """Take in one map image whose words are known; ids not given so far are new words."""
        new = np.flatnonzero(words >= len(self))
        first = new[np.unique(words[new], return_index=True)[1]]
        begin = len(self)
        self._ends.append(begin + len(first))
        if not self.switches.purge:
            self.words.append(descriptors[first], None if lists is None else lists[first])
            return
        self._young.append(_Young(descriptors[first], begin, np.zeros(len(first), np.int64)))
        for one in self._young:
            mine = words[(one.begin <= words) & (words < one.begin + len(one.seen))]
            one.seen += np.bincount(mine - one.begin, minlength=len(one.seen))
        if len(self._young) > WAIT:
            oldest = self._young.pop(0)
            kept = oldest.seen >= SEEN
            self.words.append(oldest.descriptors[kept])
            self._names = np.append(self._names, oldest.names[kept])

    def held(self, words: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return the words of a map image (int32 [n]) with NO_WORD for those that were dropped since."""
        if not self.switches.purge:
            return words
        names = np.concatenate([self._names, *(one.names for one in self._young), [NO_WORD]])  # rising but for the end
        return np.where(names[np.searchsorted(names[:-1], words)] == words, words, NO_WORD).astype(np.int32)

    def descriptors(self, words: NDArray[np.int32]) -> NDArray[np.uint8]:
        """Return the descriptors of words (int32 [n], none of them dropped) as uint8 [n, 32]."""
        if not self.switches.purge:
            return self.words.rows(words)
        names = np.concatenate([self._names, *(one.names for one in self._young)])  # rising
        place = np.searchsorted(names, words)
        old = place < len(self._names)
        result = np.empty((len(words), 32), np.uint8)
        result[old] = self.words.rows(place[old])
        young = np.concatenate([np.zeros((0, 32), np.uint8), *(one.descriptors for one in self._young)])
        result[~old] = young[place[~old] - len(self._names)]
        return result

    def arrays(self) -> dict[str, NDArray]:
        """Return everything that is kept, for storage; ``from_arrays`` takes it back."""
        kept = self.words.arrays() | {"names": self._names, "ends": np.array(self._ends, np.int64)}
        kept["young"] = np.concatenate([np.zeros((0, 32), np.uint8), *(one.descriptors for one in self._young)])
        kept["young_seen"] = np.concatenate([np.zeros(0, np.int64), *(one.seen for one in self._young)])
        return kept

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray], switches: config.Vocabulary) -> Vocabulary:
        """Return a vocabulary from what ``arrays`` gave, under the same switches as it was learned with."""
        vocabulary = cls(switches)
        vocabulary.words = Words.from_arrays(arrays, switches.exact_below, switches.probes)
        vocabulary._names, vocabulary._ends = np.array(arrays["names"]), arrays["ends"].tolist()
        begins = [0, *vocabulary._ends][:-1][-WAIT:] if switches.purge else []  # of the ids of the last images
        cuts = [begin - begins[0] for begin in begins[1:]]
        recent = zip(np.split(arrays["young"], cuts), np.split(arrays["young_seen"], cuts), strict=True)
        for begin, (descriptors, seen) in zip(begins, recent, strict=False):
            vocabulary._young.append(_Young(np.array(descriptors), begin, np.array(seen)))
        return vocabulary


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
        vocabulary.post(descriptors, words)
        yield
