"""The OBBs of frames, as a stored stage: a detector looks at an image once, whatever is then done with its boxes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fdslam.context import ensure, load
from fdslam.data.images import LIBRARIES, read_image
from fdslam.obb import Library, Source, joined
from fdslam.store import Arrays, Key, Stage, Store
from fdslam.types import Boxes, Frame


def _stage(source: Source) -> Stage:
    return Stage("obbs", (source.module, "fdslam.data.images"), LIBRARIES)


def _make(source: Source, frame: Frame) -> Arrays:
    return {"boxes": source.boxes(read_image(frame.path))}


class Proposals:
    """OBBs of frames; those of costly sources are found once, each source by itself, and stored."""

    def __init__(self, library: Library, store: Store, workers: int) -> None:
        self.library, self.store, self.workers = library, store, workers

    @staticmethod
    def _key(source: Source, frame: Frame) -> Key:
        return _stage(source).key(source.identity, [frame.digest])

    def ensure(self, frames: Sequence[Frame], label: str) -> None:
        """Find, in parallel, what is not stored yet."""
        for name, source in self.library.sources.items():
            if source.module:
                jobs = {self._key(source, frame): partial(_make, source, frame) for frame in frames}
                ensure(self.store, _stage(source), jobs, self.workers, f"{name}, OBBs of {label}")

    def missing(self, frames: Sequence[Frame]) -> int:
        """Count the looks at images that costly sources still have to take, by the files of what is stored alone."""
        costly = [source for source in self.library.sources.values() if source.module]
        return sum(self.store.lacks(_stage(one), (self._key(one, frame) for frame in frames)) for one in costly)

    def of(self, frame: Frame) -> Boxes:
        """Return the OBBs of one frame."""
        return joined({name: self._of(source, frame) for name, source in self.library.sources.items()})

    def _of(self, source: Source, frame: Frame) -> NDArray[np.float32]:
        if not source.module:
            return source.boxes(np.broadcast_to(np.uint8(0), (frame.height, frame.width, 3)))  # the size is enough
        return load(self.store, _stage(source), self._key(source, frame), partial(_make, source, frame))["boxes"]
