"""A bag-of-words map as one thing: its vocabulary and its inverted file, kept in one file."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

from fdslam import config
from fdslam.bow import mapfile
from fdslam.bow.documents import ObbDocuments
from fdslam.bow.index import InvertedFile
from fdslam.bow.vocabulary import Vocabulary

VERSION = 1  # of what the file holds


@dataclass(frozen=True)
class BagOfWords:
    """What queries are localised in; it goes on growing when it was loaded from a file."""

    vocabulary: Vocabulary
    index: InvertedFile | ObbDocuments

    @property
    def nbytes(self) -> int:
        """Bytes of all it holds."""
        return self.vocabulary.nbytes + self.index.nbytes

    def save(self, path: Path) -> None:
        """Write the map to one file, atomically, with version and checksum.

        Raises:
            InputError: the disk refuses.
        """
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
        return cls(Vocabulary.from_arrays(arrays, config.Vocabulary(**settings)), kind.from_arrays(arrays))
