"""Product quantisation of SIFTs: each part of a descriptor becomes the number of its nearest codeword (§PC, ours).

Codewords are whole numbers like the SIFTs themselves, so encoding, decoding and the distances to what is decoded are
exact; only the training of the codebook rounds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sklearn.cluster import KMeans
from threadpoolctl import threadpool_limits

from fdslam.nearest import LENGTH

WORDS = 256  # codewords of a part: one byte
ITERATIONS = 25

Codebook = NDArray[np.uint8]  # [parts, WORDS, LENGTH / parts]


def train(descriptors: NDArray[np.uint8], parts: int, seed: int) -> Codebook:
    """Return a codebook for descriptors like these: k-means in each part by itself.

    Args:
        descriptors: uint8 ``[n, 128]``, n >= 1. With up to 256 different ones in a part, they are its codewords.
        parts: into which a descriptor is cut, a divisor of 128; as many bytes are left of it.
        seed: of k-means++.

    Raises:
        ValueError: no descriptor, or ``parts`` does not divide 128.

    Source: Jégou, Douze & Schmid, "Product quantization for nearest neighbor search" (2011).
    """
    if len(descriptors) == 0 or LENGTH % parts:
        raise ValueError(f"a codebook of {parts} parts from {len(descriptors)} descriptors of length {LENGTH}")
    cut = descriptors.reshape(len(descriptors), parts, -1)
    return np.stack([_words(np.ascontiguousarray(cut[:, part]), seed) for part in range(parts)])


def _words(rows: NDArray[np.uint8], seed: int) -> NDArray[np.uint8]:
    distinct = np.unique(rows, axis=0)
    if len(distinct) <= WORDS:
        return np.resize(distinct, (WORDS, rows.shape[1]))
    # One thread, as for the places: sums in another order would round differently.
    with threadpool_limits(limits=1):
        means = KMeans(WORDS, n_init=1, max_iter=ITERATIONS, random_state=seed).fit(rows.astype(np.float32))
    return np.rint(means.cluster_centers_).astype(np.uint8)


def encode(descriptors: NDArray[np.uint8], codebook: Codebook) -> NDArray[np.uint8]:
    """Return the number of the nearest codeword, the first of equals, for each part: uint8 ``[n, parts]``.

    Args:
        descriptors: uint8 ``[n, 128]``.
        codebook: as ``train`` returns it.
    """
    parts, _, length = codebook.shape
    cut = descriptors.reshape(len(descriptors), parts, length).astype(np.float32)
    words = codebook.astype(np.float32)
    half = np.einsum("pwl,pwl->pw", words, words) / 2  # of whole numbers: exact, as in nearest.py
    nearest = [np.argmin(half[p] - cut[:, p] @ words[p].T, axis=1) for p in range(parts)]
    return np.stack(nearest, axis=1).astype(np.uint8)


def decode(codes: NDArray[np.uint8], codebook: Codebook) -> NDArray[np.uint8]:
    """Return the descriptors that codes stand for, uint8 ``[n, 128]``."""
    return codebook[np.arange(len(codebook)), codes].reshape(-1, LENGTH)
