"""Map documents: instead of an image with all its keypoints, each of its OBBs can be posted with those it holds (§FD).

M and M_w of idf then count OBBs, a feature is posted once for each OBB that holds it, and the score of an image is that
of its best OBB.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fdslam.bow.index import InvertedFile, without


def best_of(scores: NDArray[np.int64], owner: NDArray[np.int32], images: int) -> NDArray[np.int64]:
    """Return the score of every image, that of its best document; 0 without any.

    Args:
        scores: int64 [J, D], not negative.
        owner: int32 [D], rising, the image of each document.
        images: M.

    Returns:
        int64 [J, M].
    """
    best = np.zeros((len(scores), images), np.int64)
    holding, first = np.unique(owner, return_index=True)
    if len(holding) and len(scores):
        best[:, holding] = np.maximum.reduceat(scores, first, axis=1)
    return best


class ObbDocuments:
    """An index of the OBBs of map images that answers for the images."""

    def __init__(self, index: InvertedFile, owner: NDArray[np.int32], images: int) -> None:
        """Take an index of D documents, the image of each (int32 [D], rising) and the number of images M."""
        self.index, self.owner, self.images = index, owner, images

    @property
    def nbytes(self) -> int:
        """Bytes of all it holds."""
        return self.index.nbytes + self.owner.nbytes

    @classmethod
    def post(
        cls, words: Sequence[NDArray[np.int32]], inside: Sequence[NDArray[np.bool_]], vocabulary_size: int
    ) -> ObbDocuments:
        """Return an index of all map images; the arguments are those of ``add``."""
        documents = cls(InvertedFile([], 0), np.zeros(0, np.int32), 0)
        documents.add(words, inside, vocabulary_size)
        return documents

    def add(
        self, words: Sequence[NDArray[np.int32]], inside: Sequence[NDArray[np.bool_]], vocabulary_size: int
    ) -> None:
        """Post the OBBs of images after those there; OBBs without a keypoint are left out.

        Args:
            words: for each image int32 [n], the words of its keypoints.
            inside: for each image bool [B, n], which of its OBBs holds which keypoint.
            vocabulary_size: number of words.
        """
        documents = [found[box] for found, boxes in zip(words, inside, strict=True) for box in boxes if box.any()]
        ids = np.arange(self.images, self.images + len(words), dtype=np.int32)
        owner = np.repeat(ids, [int(boxes.any(axis=1).sum()) for boxes in inside])
        self.index.add(documents, vocabulary_size)
        self.owner, self.images = np.concatenate([self.owner, owner]), self.images + len(words)

    def remove(self, images: NDArray[np.integer]) -> None:
        """Forget these map ids; the rest move up.

        Raises:
            IndexError: there is no such image.
        """
        kept, names = without(self.images, images)
        self.index.remove(np.flatnonzero(~kept[self.owner]))
        self.owner, self.images = names[self.owner[kept[self.owner]]], int(kept.sum())

    def arrays(self) -> dict[str, NDArray]:
        """Return everything that is kept, for storage; ``from_arrays`` takes it back."""
        return self.index.arrays() | {"owner": self.owner, "owners": np.array([self.images])}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray]) -> ObbDocuments:
        """Return an index from what ``arrays`` gave; the large ones may be mapped and are not copied."""
        return cls(InvertedFile.from_arrays(arrays), arrays["owner"], int(arrays["owners"][0]))

    def scores(self, words: NDArray[np.int32], inside: NDArray[np.bool_], score: str) -> NDArray[np.int64]:
        """Return the scores of the images, int64 [J, M], as ``InvertedFile.scores`` does where images are posted."""
        return best_of(self.index.scores(words, inside, score), self.owner, self.images)
