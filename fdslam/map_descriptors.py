"""The local features of frames, and what is kept of those of the map: SIFTs as they are, or codes of them (§PC)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from fdslam.config import Keypoints, Pc, part
from fdslam.context import Context, load
from fdslam.data.images import LIBRARIES, enlarge, read_image
from fdslam.harris_laplace import harris_laplace, sift
from fdslam.quantisation import Codebook, decode, encode, train
from fdslam.sampling import evenly
from fdslam.store import Arrays, Key, Stage
from fdslam.types import Frame

FEATURES = Stage("pc_features", ("fdslam.map_descriptors",), LIBRARIES)
CODEBOOK = Stage("pc_codebook", ("fdslam.map_descriptors",), ("scikit-learn", "numpy", *LIBRARIES))
CODES = Stage("pc_codes", ("fdslam.map_descriptors",), ("numpy",))
TEACHERS, LESSONS = 64, 256  # map images that the codebook is trained on, and descriptors of each


def features_key(frame: Frame, config: Pc) -> Key:
    """Return the address of a frame's SIFTs."""
    return FEATURES.key(part(config, Keypoints), [frame.digest])


def extract(frame: Frame, config: Pc) -> Arrays:
    """Return keypoints (float32 [n, 2], pixels of the frame, whole) and their SIFTs (uint8 [n, 128])."""
    image, stretch = enlarge(read_image(frame.path), config.min_side)
    keypoints = harris_laplace(image, config, config.threads)
    xy = np.floor((keypoints.xy + np.float32(0.5)) / stretch)
    return {"xy": xy, "sift": sift(image, keypoints).astype(np.uint8)}  # whole numbers up to 255


def features(context: Context, frame: Frame) -> Arrays:
    """Return the keypoints and SIFTs of one frame."""
    config = context.config.pc
    return load(context.store, FEATURES, features_key(frame, config), partial(extract, frame, config))


class MapDescriptors:
    """What a query is compared with.

    With ``pc.descriptors: exact`` that are the map images' SIFTs: whole numbers up to 255, so a byte an entry loses
    nothing, and float16 would only be larger. With ``pq`` each is ``pc.code_bytes`` bytes of a codebook that is trained
    on the map itself.
    """

    def __init__(self, context: Context) -> None:
        """Look at a run; nothing is computed yet."""
        self.context, self.config = context, context.config.pc
        self.coded = self.config.descriptors == "pq"

    @property
    def teachers(self) -> list[Frame]:
        """The map images that have to be described before any can be encoded: spread evenly over the map."""
        frames = self.context.dataset.map
        if not self.coded:
            return []
        return [frames[i] for i in evenly(len(frames), TEACHERS)]

    @cached_property
    def _codebook_key(self) -> Key:
        settings = {"parts": self.config.code_bytes, "seed": self.context.config.seed}
        return CODEBOOK.key(settings, [features_key(frame, self.config) for frame in self.teachers])

    def key(self, image: int) -> Key:
        """Return the address of a map image's descriptors."""
        found = features_key(self.context.dataset.map[image], self.config)
        return CODES.key({}, [found, self._codebook_key]) if self.coded else found

    def _train(self) -> Arrays:
        rng = np.random.default_rng(self.context.config.seed)
        lessons = [np.empty((0, 128), np.uint8)]
        for frame in self.teachers:
            rows = features(self.context, frame)["sift"]
            lessons.append(rows[np.sort(rng.permutation(len(rows))[:LESSONS])])
        all_of_them = np.concatenate(lessons)
        if not len(all_of_them):  # a map without a keypoint
            all_of_them = np.zeros((1, 128), np.uint8)
        return {"codebook": train(all_of_them, self.config.code_bytes, self.context.config.seed)}

    @cached_property
    def codebook(self) -> Codebook:
        """The codebook, trained and stored if it is not there yet."""
        return load(self.context.store, CODEBOOK, self._codebook_key, self._train)["codebook"]

    def _stored(self, image: int) -> Arrays:
        frame = self.context.dataset.map[image]
        if not self.coded:
            return features(self.context, frame)

        def code() -> Arrays:
            return {"codes": encode(features(self.context, frame)["sift"], self.codebook)}

        return load(self.context.store, CODES, self.key(image), code)

    def of(self, image: int) -> NDArray[np.uint8]:
        """Return the descriptors of a map image, uint8 [n, 128]."""
        arrays = self._stored(image)
        return decode(arrays["codes"], self.codebook) if self.coded else arrays["sift"]

    def kept(self, images: Sequence[int]) -> float:
        """Return the mean bytes that a comparison needs of these map images, with their share of the codebook.

        Positions, which lie beside the SIFTs in the store, are not among them.
        """
        if not images:
            return 0.0
        sizes = [self._stored(image)["codes" if self.coded else "sift"].nbytes for image in images]
        shared = self.codebook.nbytes / len(self.context.dataset.map) if self.coded else 0.0
        return float(np.mean(sizes)) + shared
