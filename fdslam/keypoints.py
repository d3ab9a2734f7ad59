"""The ORB features of frames, as a stored stage: extracted once, when first asked for."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from fdslam.bow.orb import extract
from fdslam.config import Bow, Orb, part
from fdslam.context import ensure, load
from fdslam.data.images import LIBRARIES, read_image
from fdslam.store import Arrays, Key, Stage, Store
from fdslam.types import Features, Frame

FEATURES = Stage("features", ("fdslam.bow.orb",), LIBRARIES)


def _extract(frame: Frame, config: Bow) -> Arrays:
    features = extract(read_image(frame.path), config)
    return {"xy": features.xy, "descriptors": features.descriptors}


class FeatureStore:
    """ORB features of frames, extracted when first asked for."""

    def __init__(self, config: Bow, store: Store, workers: int) -> None:
        self.config, self.store, self.workers = config, store, workers

    def key(self, frame: Frame) -> Key:
        """Return the address of a frame's features."""
        return FEATURES.key(part(self.config, Orb), [frame.digest])

    def ensure(self, frames: Sequence[Frame], label: str) -> None:
        """Extract, in parallel, what is not stored yet."""
        jobs = {self.key(frame): partial(_extract, frame, self.config) for frame in frames}
        ensure(self.store, FEATURES, jobs, self.workers, label)

    def load(self, frame: Frame) -> Features:
        """Return the features of one frame."""
        return Features(**load(self.store, FEATURES, self.key(frame), partial(_extract, frame, self.config)))
