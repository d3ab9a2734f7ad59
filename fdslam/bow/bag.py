"""A bag-of-words map as one thing: its vocabulary and its inverted file, grown, asked and stored together."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fdslam import config
from fdslam.bow import mapfile
from fdslam.bow.documents import ObbDocuments
from fdslam.bow.gate import Gate
from fdslam.bow.index import InvertedFile, check_sizes
from fdslam.bow.vocabulary import Vocabulary
from fdslam.errors import InputError

VERSION = 1  # of what the file holds


@dataclass(frozen=True)
class BagOfWords:
    """What queries are localised in.

    Any number of threads may ask while another adds or removes: each answer is that of the map before or after.
    """

    vocabulary: Vocabulary
    index: InvertedFile | ObbDocuments
    _gate: Gate = field(default_factory=Gate, compare=False)

    @property
    def nbytes(self) -> int:
        """Bytes of all it holds."""
        return self.vocabulary.nbytes + self.index.nbytes

    def add(self, descriptors: NDArray[np.uint8], inside: NDArray[np.bool_] | None = None) -> NDArray[np.int32]:
        """Append a map image; its id is the number of those before.

        Args:
            descriptors: uint8 [n, 32].
            inside: bool [B, n], which of its OBBs holds which keypoint; for a map that posts OBBs.

        Returns:
            int32 [n], the words of its keypoints.

        Raises:
            InputError: more keypoints than scores hold.
            ValueError: the map posts OBBs, and ``inside`` is missing. In either case nothing is learned.
        """
        check_sizes([descriptors])
        if isinstance(self.index, ObbDocuments) and inside is None:
            raise ValueError("this map posts OBBs: say which keypoints each of the image's OBBs holds")
        with self._gate.writing():
            words = self.vocabulary.learn(descriptors)
            if isinstance(self.index, InvertedFile):
                self.index.add([words], len(self.vocabulary))
            elif inside is not None:
                self.index.add([words], [inside], len(self.vocabulary))
            return words

    def remove(self, images: NDArray[np.integer]) -> None:
        """Forget these map ids, e.g. a session's; later ids move up.

        What they alone had taught the vocabulary stays in it: words never change.

        Raises:
            IndexError: there is no such image.
        """
        with self._gate.writing():
            self.index.remove(images)

    def match(self, descriptors: NDArray[np.uint8]) -> NDArray[np.int32]:
        """Return the word of each descriptor (uint8 [n, 32]) as int32 [n], NO_WORD where there is none."""
        with self._gate.reading():
            return self.vocabulary.match(descriptors)

    def scores(self, words: NDArray[np.int32], inside: NDArray[np.bool_], score: str) -> NDArray[np.int64]:
        """Return s_j(m) of every OBB j of a query (bool [J, n]) and map image m, int64 [J, M]."""
        with self._gate.reading():
            return self.index.scores(words, inside, score)

    def save(self, path: Path) -> None:
        """Write the map to one file, atomically, with version and checksum.

        Raises:
            InputError: the disk refuses.
        """
        with self._gate.writing():  # storing puts words and postings in order
            arrays = self.vocabulary.arrays() | self.index.arrays()
            mapfile.save(path, arrays, VERSION, asdict(self.vocabulary.switches))

    @classmethod
    def load(cls, path: Path) -> BagOfWords:
        """Return the map in a file, mapped into memory.

        Raises:
            InputError: no such file, not a map, of another version, or damaged.
        """
        arrays, settings = mapfile.load(path, VERSION)
        kind = ObbDocuments if "owner" in arrays else InvertedFile
        try:
            return cls(Vocabulary.from_arrays(arrays, config.Vocabulary(**settings)), kind.from_arrays(arrays))
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"{path}: a map that is laid out otherwise ({error}); build the map again") from error
