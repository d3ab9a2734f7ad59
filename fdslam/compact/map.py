"""The compact binary map, as stored stages: per map image which words were where, and packed dense descriptors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from fdslam.compact.evidence import LEVELS, Looks
from fdslam.compact.signs import Centring, centring, stored
from fdslam.compact.source import Source
from fdslam.config import Dense
from fdslam.context import Words, ensure, load
from fdslam.data.images import LIBRARIES, read_image
from fdslam.sampling import evenly
from fdslam.store import Arrays, Key, Stage, Store
from fdslam.types import Features, Frame

SIGNS = Stage("dense_signs", ("fdslam.compact.signs", "fdslam.data.images"), LIBRARIES)
SIZE = Stage("compact_size", ("fdslam.compact.map",))
WHOLE = 65_535  # a position's units: this many a side of the image
RECENT = 64  # map images whose unpacked words are kept at hand


@dataclass(frozen=True)
class Placed:
    """Which words a map image holds and where, as few bytes as it takes.

    Most words of an image were born with it and have ids that follow on: of those one bit each is kept.
    """

    xy: NDArray[np.uint16]  # [n, 2] shares of the width and the height, in units of 1 / WHOLE
    born: NDArray[np.uint8]  # [⌈n / 8⌉] bits: whether the word is the next of those born with the image
    older: NDArray[np.int32]  # the other words, in the order of the keypoints
    first: int  # id of the first word that was born with the image

    @property
    def nbytes(self) -> int:
        """Bytes of all it holds."""
        return self.xy.nbytes + self.born.nbytes + self.older.nbytes + 8

    @classmethod
    def pack(cls, words: NDArray[np.int32], xy: NDArray[np.float32], height: int, width: int, first: int) -> Placed:
        """Return words (int32 [n]) at places (float32 [n, 2] pixels) of an image of that size in few bytes."""
        highest = np.maximum.accumulate(np.concatenate([[first - 1], words]))
        born = words == highest[:-1] + 1  # the next new one
        units = np.rint(xy * (WHOLE / np.array([width, height]))).astype(np.uint16)
        return cls(units, np.packbits(born), words[~born], first)

    def words(self) -> NDArray[np.int32]:
        """Return the words, int32 [n]."""
        born = np.unpackbits(self.born, count=len(self.xy)).astype(bool)
        words = np.empty(len(born), np.int32)
        words[born] = self.first + np.arange(np.count_nonzero(born))
        words[~born] = self.older
        return words

    def places(self, height: int, width: int) -> NDArray[np.float32]:
        """Return where the words are, float32 [n, 2] pixels."""
        return (self.xy * (np.array([width, height]) / WHOLE)).astype(np.float32)


class CompactMap:
    """What a map keeps of its images' looks, and where their words were; and the looks of queries beside it."""

    def __init__(
        self,
        frames: Sequence[Frame],
        source: Source,
        config: Dense,
        bow: Words,
        store: Store,
        workers: int,
        learned: int | None = None,
    ) -> None:
        """Take what it is made of; ``learned``: how many of its images descriptors are centred on, without it all."""
        self.frames, self.source, self.config, self.bow = tuple(frames), source, config, bow
        self.store, self.workers, self.learned = store, workers, learned or len(frames)
        self._placed = lru_cache(RECENT)(self._unpacked)

    def _sample(self) -> list[Frame]:
        return [self.frames[i] for i in evenly(self.learned, self.config.sample)]

    @cached_property
    def centring_key(self) -> Key:
        """The address of what the descriptors are centred on."""
        bits = {"fine": self.config.fine_bits, "coarse": self.config.coarse_bits}
        inputs = [frame.digest for frame in self._sample()]
        return self._centring.key({"source": self.source.identity, **bits}, inputs)

    @property
    def _centring(self) -> Stage:
        described = type(self.source).__module__, "fdslam.compact.signs", "fdslam.data.images"
        return Stage("dense_centring", described, LIBRARIES)

    @cached_property
    def centrings(self) -> tuple[Centring, Centring]:
        """What makes bits of descriptors, fine and coarse."""
        arrays = load(self.store, self._centring, self.centring_key, self._fit)
        return stored(arrays, "fine"), stored(arrays, "coarse")

    def _fit(self) -> Arrays:
        seen = [self.source.describe(read_image(frame.path)) for frame in self._sample()]
        bits = self.config.fine_bits, self.config.coarse_bits
        fine, coarse = (centring([one[i] for one in seen], bits[i]) for i in range(2))
        return fine.arrays("fine") | coarse.arrays("coarse")

    def key(self, frame: Frame) -> Key:
        """Return the address of an image's descriptors."""
        return SIGNS.key({}, [self.centring_key, frame.digest])

    def ensure(self, frames: Sequence[Frame], label: str) -> None:
        """Describe, in parallel, what is not described yet."""
        jobs = {self.key(frame): partial(self._describe, frame) for frame in frames}
        if any(not self.store.has(SIGNS, key) for key in jobs):
            _ = self.centrings  # fitted once here, before threads ask for it
        ensure(self.store, SIGNS, jobs, self.workers, label)

    def _describe(self, frame: Frame) -> Arrays:
        return dict(zip(LEVELS, self.look(read_image(frame.path)).signs, strict=True))

    def look(self, image: NDArray[np.uint8]) -> Looks:
        """Return the descriptors of an image (uint8 RGB [H, W, 3])."""
        values = self.source.describe(image)
        signs = tuple(one.signs(level) for one, level in zip(self.centrings, values, strict=True))
        return self._looks((signs[0], signs[1]), *image.shape[:2])

    def _looks(self, signs: tuple[NDArray[np.uint64], NDArray[np.uint64]], height: int, width: int) -> Looks:
        fine, coarse = self.centrings
        return Looks(signs, self.source.grids(height, width), (fine.bits, coarse.bits))

    def looks(self, frame: Frame) -> Looks:
        """Return the descriptors of a query or a map image, from the store."""
        arrays = load(self.store, SIGNS, self.key(frame), partial(self._describe, frame))
        return self._looks((arrays["fine"], arrays["coarse"]), frame.height, frame.width)

    def size(self, image: int) -> tuple[int, int]:
        """Return height and width of a map image, pixels."""
        return self.frames[image].height, self.frames[image].width

    def placed(self, image: int) -> Placed:
        """Return which words a map image holds and where."""
        words, xy = self.bow.posted(image)
        frame = self.frames[image]
        return Placed.pack(words, xy, frame.height, frame.width, self.bow.born(image)[0])

    def words(self, image: int) -> Features:
        """Return the words of a map image as keypoints with their words' descriptors, at the places that are kept."""
        return self._placed(image)

    def _unpacked(self, image: int) -> Features:
        kept, frame = self.placed(image), self.frames[image]
        return Features(kept.places(frame.height, frame.width), self.bow.descriptors(kept.words()))

    def kept(self) -> float:
        """Return the bytes per map image beside the bag of words: descriptors, and which words were where."""
        key = SIZE.key({}, [self.centring_key, self.bow.identity])
        return float(load(self.store, SIZE, key, lambda: {"bytes": np.array(self._measured())})["bytes"])

    def _measured(self) -> float:
        dense = sum(array.nbytes for frame in self.frames for array in self.looks(frame).signs)
        words = sum(self.placed(image).nbytes for image in range(len(self.frames)))
        centring_bytes = sum(array.nbytes for one in self.centrings for array in one.arrays("").values())
        return (dense + words + centring_bytes) / len(self.frames)
