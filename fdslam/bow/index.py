"""Inverted file with integer TF-IDF: the weak lists of all OBBs of a query in one sparse product (§FD).

s_j(m) = Σ_w n_jw² · idf_w · c_wm, with idf_w = ln(M / M_w) in fixed point. Scores are integers, so they do not depend
on the order of words, OBBs, images or threads, and ties are exact. The factor 1 / n_j of the usual score is constant
within a list and is left out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from fdslam.bow.vocabulary import NO_WORD

IDF_ONE = 1 << 16  # fixed-point 1.0 of idf: with 1500 keypoints an int64 score has room for maps of any size


def fixed_point_idf(images: int, images_with_word: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return round(ln(M / M_w) · IDF_ONE) as int64 [words]; 0 for a word that no image holds."""
    share = np.maximum(images_with_word, 1) / max(images, 1)
    return np.where(images_with_word > 0, np.rint(-np.log(share) * IDF_ONE), 0).astype(np.int64)


class InvertedFile:
    """Which map image holds which word how often."""

    def __init__(self, words: Sequence[NDArray[np.int32]], vocabulary_size: int) -> None:
        """Post the words of every map image.

        Args:
            words: for each of the M map images, in order, int32 [n] word ids (NO_WORD: not posted).
            vocabulary_size: number of words.
        """
        image = np.repeat(np.arange(len(words)), [len(w) for w in words])
        word = np.concatenate([np.zeros(0, np.int32), *words])
        posted = word != NO_WORD
        ones = np.ones(posted.sum(), np.int64)
        shape = (vocabulary_size, len(words))
        self.counts = sparse.csr_array((ones, (word[posted], image[posted])), shape=shape)  # c_wm, duplicates summed
        self.idf = fixed_point_idf(len(words), np.diff(self.counts.indptr).astype(np.int64))

    def scores(self, words: NDArray[np.int32], inside: NDArray[np.bool_], score: str) -> NDArray[np.int64]:
        """Return s_j(m) of every OBB j and map image m.

        Args:
            words: int32 [n], the word of each query keypoint or NO_WORD.
            inside: bool [J, n], whether keypoint n lies in OBB j.
            score: "ibow" (n_jw² idf c), "tfidf" (n_jw idf c) or "binary" (idf once if both hold the word).

        Returns:
            int64 [J, M].
        """
        known = words != NO_WORD
        distinct, column = np.unique(words[known], return_inverse=True)
        keypoint_word = sparse.csr_array(
            (np.ones(len(column), np.int64), (np.arange(len(column)), column)), shape=(len(column), len(distinct))
        )
        counts = sparse.csr_array(inside[:, known].astype(np.int64)) @ keypoint_word  # n_jw
        postings = self.counts[distinct]
        if score == "ibow":
            counts.data **= 2
        elif score == "binary":
            counts.data[:] = 1
            postings.data[:] = 1
        weighted = counts @ sparse.diags_array(self.idf[distinct], dtype=np.int64)
        return np.asarray((weighted @ postings).todense(), np.int64)


def ranks_of(scores: NDArray[np.int64], unretrieved: str) -> NDArray[np.int32]:
    """Return the rank of every map image in every list, 1 = best.

    Ties share the best rank of their group. Images never retrieved (score 0) get rank M ("last") or the rank after all
    retrieved ones ("next").

    Args:
        scores: int64 [J, M].
        unretrieved: "last" or "next".

    Returns:
        int32 [J, M].
    """
    lists, images = scores.shape
    order = np.argsort(-scores, axis=1, kind="stable")
    falling = np.take_along_axis(scores, order, axis=1)
    position = np.broadcast_to(np.arange(images), scores.shape)
    starts = np.concatenate([np.ones((lists, 1), bool), falling[:, 1:] != falling[:, :-1]], axis=1)
    best = np.maximum.accumulate(np.where(starts, position, 0), axis=1) + 1
    if unretrieved == "last":
        best = np.where(falling == 0, images, best)
    ranks = np.empty(scores.shape, np.int32)
    np.put_along_axis(ranks, order, best.astype(np.int32), axis=1)
    return ranks
