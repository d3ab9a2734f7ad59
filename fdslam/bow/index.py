"""Inverted file with integer TF-IDF: the weak lists of all OBBs of any number of queries in one sparse product (§FD).

s_j(m) = Σ_w n_jw² · idf_w · c_wm, with idf_w = ln(M / M_w) in fixed point. Scores are integers, so they do not depend
on the order of words, OBBs, images, threads or parts, and ties are exact. The factor 1 / n_j of the usual score is
constant within a list and is left out.

Postings lie in a few sorted segments. An added image is a new segment; a segment is merged with the one before it as
soon as it is no smaller, so that every posting is moved about log₂ M times in all and a large map stays untouched.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from fdslam.bow.vocabulary import NO_WORD
from fdslam.errors import InputError

IDF_ONE = 1 << 16  # fixed-point 1.0 of idf
MOST = 20_000  # keypoints of an image: n² · c · idf then fits an int64 for maps of up to a million images
Query = tuple[NDArray[np.int32], NDArray[np.bool_]]  # [n] words of the keypoints; [J, n] which of them an OBB holds


def fixed_point_idf(images: int, images_with_word: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return round(ln(M / M_w) · IDF_ONE) as int64 [words]; 0 for a word that no image holds."""
    share = np.maximum(images_with_word, 1) / max(images, 1)
    return np.where(images_with_word > 0, np.rint(-np.log(share) * IDF_ONE), 0).astype(np.int64)


@dataclass(frozen=True)
class Segment:
    """Postings of some images, sorted by word, then image."""

    word: NDArray  # [u] int32, the words that are held, rising
    begin: NDArray  # [u + 1] int32, int64 if they must, where the postings of each begin
    image: NDArray  # [p] int32, map id
    count: NDArray  # [p] c_wm, in the smallest unsigned type that holds them

    @property
    def nbytes(self) -> int:
        """Bytes of all it holds."""
        return self.word.nbytes + self.begin.nbytes + self.image.nbytes + self.count.nbytes

    def rows(self) -> NDArray[np.int32]:
        """Return the word of every posting, int32 [p]."""
        return np.repeat(self.word, np.diff(self.begin))

    def postings(self, words: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return where the postings of these words are, and for each of them the position in ``words``."""
        place = np.minimum(np.searchsorted(self.word, words), max(len(self.word) - 1, 0))
        held = np.flatnonzero(self.word[place] == words) if len(self.word) else np.zeros(0, np.int64)
        begin = self.begin[place[held]].astype(np.int64)
        length = self.begin[place[held] + 1] - begin
        row = np.repeat(held, length)
        within = np.arange(len(row)) - np.repeat(np.cumsum(length) - length, length)
        return np.repeat(begin, length) + within, row

    def of(self, images: NDArray[np.bool_], names: NDArray[np.int32]) -> Segment:
        """Return the postings of the chosen images (bool [M]) under new map ids (int32 [M])."""
        kept = images[self.image]
        return segment(self.rows()[kept], names[self.image[kept]], self.count[kept])


def segment(word: NDArray[np.int32], image: NDArray[np.int32], count: NDArray) -> Segment:
    """Return postings (word, image, count) that are in the order of word, then image, as a segment."""
    starts = np.flatnonzero(np.concatenate([[True], word[1:] != word[:-1]])) if len(word) else np.zeros(0, np.int64)
    offsets = np.int32 if len(word) < 1 << 31 else np.int64
    begin = np.append(starts, len(word)).astype(offsets)
    return Segment(word[starts], begin, image, count.astype(np.min_scalar_type(int(count.max(initial=0)))))


def merged(parts: Sequence[Segment]) -> Segment:
    """Return the postings of all parts, each of later images than the one before it, as one segment."""
    word = np.concatenate([part.rows() for part in parts])
    order = np.argsort(word, kind="stable")  # merges sorted runs, and leaves the images of a word in order
    image = np.concatenate([part.image for part in parts])[order]
    return segment(word[order], image, np.concatenate([part.count for part in parts])[order])


def without(count: int, gone: NDArray[np.integer]) -> tuple[NDArray[np.bool_], NDArray[np.int32]]:
    """Return which of ``count`` ids are kept when some go, bool [count], and the new id of each that is, int32 [count].

    Raises:
        IndexError: an id is not below ``count``, or negative.
    """
    ids = np.asarray(gone, np.int64)
    if ids.size and not 0 <= ids.min() <= ids.max() < count:
        raise IndexError(f"map ids {ids.min()} to {ids.max()}: there are {count}")
    kept = np.ones(count, bool)
    kept[ids] = False
    return kept, (np.cumsum(kept) - 1).astype(np.int32)


class InvertedFile:
    """Which map image holds which word how often."""

    def __init__(self, words: Sequence[NDArray[np.int32]], vocabulary_size: int) -> None:
        """Post the words of every map image.

        Args:
            words: for each of the M map images, in order, int32 [n] word ids (NO_WORD: not posted).
            vocabulary_size: number of words.
        """
        self.images = self._size = 0  # M of idf: that of the whole map, also in a part of it of fewer images
        self.vocabulary_size = 0
        self._segments: list[Segment] = []
        self._holding = np.zeros(0, np.int32)  # M_w
        self.add(words, vocabulary_size)

    @property
    def nbytes(self) -> int:
        """Bytes of all it holds."""
        return self._holding.nbytes + sum(part.nbytes for part in self._segments)

    def add(self, words: Sequence[NDArray[np.int32]], vocabulary_size: int) -> None:
        """Append images after those there; the result is that of an index built at once.

        Raises:
            InputError: an image has more than MOST keypoints.
            ValueError: this is a part of a map.
        """
        self._check_whole()
        check_sizes(words)
        self.vocabulary_size = max(self.vocabulary_size, vocabulary_size)
        if vocabulary_size > len(self._holding):  # an eighth more than asked, so that the copies cost little
            more = vocabulary_size + vocabulary_size // 8 - len(self._holding)
            self._holding = np.append(self._holding, np.zeros(more, np.int32))
        image = np.repeat(np.arange(len(words), dtype=np.int64) + self.images, [len(w) for w in words])
        word = np.concatenate([np.zeros(0, np.int32), *words])
        posted = word != NO_WORD
        pair, count = np.unique(word[posted].astype(np.int64) << 32 | image[posted], return_counts=True)
        self._push(segment((pair >> 32).astype(np.int32), (pair & 0xFFFFFFFF).astype(np.int32), count))
        self.images += len(words)
        self._size = self.images

    def _check_whole(self) -> None:
        if self._size != self.images:
            raise ValueError("a part of a map does not change: change the whole and split it again")

    def _push(self, new: Segment) -> None:
        self._holding[new.word] += np.diff(new.begin).astype(np.int32)
        while self._segments and len(self._segments[-1].image) <= len(new.image):
            new = merged([self._segments.pop(), new])
        self._segments.append(new)

    def remove(self, images: NDArray[np.integer]) -> None:
        """Forget these map ids; the rest move up, and the result is that of an index built from them alone.

        Raises:
            IndexError: there is no such image.
            ValueError: this is a part of a map.
        """
        self._check_whole()
        kept, names = without(self.images, images)
        old, self._segments = self._segments, []
        self._holding[:] = 0
        for part in old:
            self._push(part.of(kept, names))
        self.images = self._size = int(kept.sum())

    def split(self, parts: int) -> tuple[InvertedFile, ...]:
        """Return parts of the map, each of a range of images, that score as the whole does: with its M and M_w."""
        bounds = np.linspace(0, self.images, parts + 1).astype(int)
        ids = np.arange(self.images)
        result = []
        for begin, end in pairwise(bounds.tolist()):
            part = InvertedFile([], 0)
            chosen = (begin <= ids) & (ids < end)
            part._segments = [one.of(chosen, (ids - begin).astype(np.int32)) for one in self._segments]
            part.vocabulary_size = self.vocabulary_size
            part.images, part._holding, part._size = self.images, self._holding.copy(), end - begin
            result.append(part)
        return tuple(result)

    def scores(self, words: NDArray[np.int32], inside: NDArray[np.bool_], score: str) -> NDArray[np.int64]:
        """Return s_j(m) of every OBB j of one query and map image m, int64 [J, M]; see ``batch_scores``."""
        return self.batch_scores([(words, inside)], score)

    def batch_scores(self, queries: Sequence[Query], score: str) -> NDArray[np.int64]:
        """Return s_j(m) of every OBB j of all queries and every map image m.

        Args:
            queries: for each the words of its keypoints (int32 [n], NO_WORD where there is none) and, bool [J, n],
                which of them lie in which OBB.
            score: "ibow" (n_jw² idf c), "tfidf" (n_jw idf c) or "binary" (idf once if both hold the word).

        Returns:
            int64 [ΣJ, M]: the lists of the first query, then those of the second, …

        Raises:
            InputError: a query has more than MOST keypoints.
        """
        if not queries:
            return np.zeros((0, self._size), np.int64)
        check_sizes([words for words, _ in queries])
        known = [words != NO_WORD for words, _ in queries]
        found = np.concatenate([np.zeros(0, np.int32), *(w[k] for (w, _), k in zip(queries, known, strict=True))])
        distinct, column = np.unique(found, return_inverse=True)
        ends = np.cumsum([k.sum() for k in known])
        counts = sparse.vstack(
            [
                _counts(inside[:, k], column[end - k.sum() : end], len(distinct))
                for (_, inside), k, end in zip(queries, known, ends, strict=True)
            ],
            format="csr",
        )
        postings = self._postings(distinct)
        if score == "ibow":
            counts.data **= 2
        elif score == "binary":
            counts.data[:] = 1
            postings.data[:] = 1
        idf = fixed_point_idf(self.images, self._holding[distinct])
        weighted = counts @ sparse.diags_array(idf, dtype=np.int64)
        return np.asarray((weighted @ postings).todense(), np.int64)

    def _postings(self, words: NDArray[np.int32]) -> sparse.csr_array:
        """Return c_wm of these words, int64 [words, M]."""
        rows, images, counts = [np.zeros(0, np.int64)], [np.zeros(0, np.int32)], [np.zeros(0, np.int64)]
        for part in self._segments:
            place, row = part.postings(words)
            rows.append(row)
            images.append(part.image[place])
            counts.append(part.count[place].astype(np.int64))
        where = (np.concatenate(rows), np.concatenate(images))
        return sparse.csr_array((np.concatenate(counts), where), shape=(len(words), self._size))

    def arrays(self) -> dict[str, NDArray]:
        """Return everything that is kept, merged into one segment, for storage; ``from_arrays`` takes it back."""
        whole = self.remerged()
        return {"word": whole.word, "begin": whole.begin, "image": whole.image, "count": whole.count} | {
            "holding": self._holding[: self.vocabulary_size],
            "images": np.array([self.images, self._size]),
        }

    def remerged(self) -> Segment:
        """Return all postings as one segment."""
        if len(self._segments) != 1:
            self._segments = [merged(self._segments)]
        return self._segments[0]

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray]) -> InvertedFile:
        """Return an index from what ``arrays`` gave; the large ones may be mapped and are not copied."""
        index = cls([], 0)
        index._segments = [Segment(*(arrays[name] for name in ("word", "begin", "image", "count")))]
        index._holding = np.array(arrays["holding"])
        index.vocabulary_size = len(index._holding)
        index.images, index._size = arrays["images"].tolist()
        return index


def check_sizes(images: Sequence[NDArray]) -> None:
    """Raise InputError if an image ([n] words or [n, 32] descriptors) has more than MOST keypoints."""
    most = max(map(len, images), default=0)
    if most > MOST:
        raise InputError(f"an image with {most} keypoints: scores hold at most {MOST}; extract fewer (bow.features)")


def _counts(inside: NDArray[np.bool_], column: NDArray[np.int64], words: int) -> sparse.csr_array:
    """Return n_jw, int64 [J, words], from the keypoints that have a word (bool [J, k]) and its position (int [k])."""
    place = (np.arange(len(column)), column)
    keypoint_word = sparse.csr_array((np.ones(len(column), np.int64), place), shape=(len(column), words))
    return sparse.csr_array(inside.astype(np.int64)) @ keypoint_word
