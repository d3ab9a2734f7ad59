"""The bag-of-words map and the localisation of queries in it, as stored stages (offline and online part of §FD)."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fdslam.bow.bag import BagOfWords
from fdslam.bow.documents import ObbDocuments
from fdslam.bow.index import InvertedFile
from fdslam.bow.orb import extract
from fdslam.bow.vocabulary import NO_WORD, Vocabulary, replay
from fdslam.config import Bow, Retrieval, part
from fdslam.config import Vocabulary as Switches
from fdslam.context import ensure, load
from fdslam.data.images import LIBRARIES
from fdslam.errors import InputError
from fdslam.keypoints import FeatureStore
from fdslam.localization import keypoints_inside, localize
from fdslam.obb import Library
from fdslam.progress import progress
from fdslam.proposals import Proposals
from fdslam.store import Arrays, Key, Stage, Store
from fdslam.types import Boxes, Features, Frame, Image, Localization

log = logging.getLogger(__name__)
PLACED = 12  # bytes of a keypoint of the map: its word, int32, and its place, two float32
VOCABULARY = Stage("vocabulary", ("fdslam.bow.vocabulary",), ("numpy",))
WORDS = Stage("words", ("fdslam.bow.vocabulary",), ("numpy",))
MAP = Stage("map", ("fdslam.mapping",), LIBRARIES)
LOCALIZATION = Stage("localization", ("fdslam.mapping",), ("scipy", *LIBRARIES))


@dataclass(frozen=True)
class _Without:
    """A map's scores for all images but one."""

    bag: BagOfWords
    image: int

    def scores(self, words: NDArray[np.int32], inside: NDArray[np.bool_], score: str) -> NDArray[np.int64]:
        """Return s_j(m) of the other images, int64 [J, M - 1]."""
        return np.delete(self.bag.scores(words, inside, score), self.image, axis=1)


class BowMap:
    """A bag-of-words map that grows image by image: what its first images give is stored and reused by longer maps."""

    def __init__(self, frames: Sequence[Frame], config: Bow, library: Library, store: Store, workers: int) -> None:
        self.frames, self.config, self.library = tuple(frames), config, library
        self.store, self.workers = store, workers
        self.features = FeatureStore(config, store, workers)
        self.proposals = Proposals(library, store, workers)
        self.keys: list[Key] = []  # of the words of each map image: a chain, as each depends on those before
        for frame in self.frames:
            inputs = [*self.keys[-1:], self.features.key(frame)]
            self.keys.append(VOCABULARY.key(part(config, Switches), inputs))

    def on(self, store: Store) -> BowMap:
        """Return the same map, sharing the bag, with another store for what is found from now on."""
        other = copy(self)
        other.store = store
        other.features = FeatureStore(self.config, store, self.workers)
        other.proposals = Proposals(self.library, store, self.workers)
        return other

    def first(self, images: int) -> BowMap:
        """Return the map as it was when it held so many images."""
        other = copy(self)
        other.frames, other.keys = self.frames[:images], self.keys[:images]
        for made in ("bag", "_held_words"):
            other.__dict__.pop(made, None)
        return other

    def prepare(self) -> None:
        """Make what is kept of the map images, and read all of it."""
        _ = self.bag
        for image, frame in enumerate(self.frames):
            self.posted(image)
            if self.config.document == "obb":
                self.proposals.of(frame)  # a map that grows is indexed anew

    @cached_property
    def bag(self) -> BagOfWords:
        """The map, from its file; made and stored if it is absent or damaged."""
        path = self.file
        if path.is_file():
            try:
                return BagOfWords.load(path)
            except InputError as error:
                log.warning("%s: it is made again", error)
        self._learn().save(path)
        return BagOfWords.load(path)

    @property
    def file(self) -> Path:
        """Where the bag of words lies, once it is made."""
        return self.store.path(MAP, self._map_key())

    @property
    def identity(self) -> str:
        """Whatever decides the map and how queries are localised in it, as one address."""
        settings = {**part(self.config, Bow), "library": self.library.identity}
        return LOCALIZATION.key(settings, self.keys[-1:])

    def missing(self, queries: Sequence[Frame]) -> tuple[int, int]:
        """Count the map images that are not learned, and the queries that are not localised, by their files alone."""
        learned = self.file.is_file()
        return (
            0 if learned else self.store.lacks(VOCABULARY, self.keys),
            self.store.lacks(LOCALIZATION, self._localization_keys(queries)),
        )

    def _localization_keys(self, queries: Sequence[Frame]) -> list[Key]:
        settings = {**part(self.config, Retrieval), "library": self.library.identity}
        return [LOCALIZATION.key(settings, [self.keys[-1], self.features.key(frame)]) for frame in queries]

    def _map_key(self) -> Key:
        documents = self.library.identity if self.config.document == "obb" else []
        return MAP.key({"documents": documents}, self.keys[-1:])

    def _learn(self) -> BagOfWords:
        self.features.ensure(self.frames, "features of the map")
        stored: list[NDArray[np.int32]] = []
        for key in self.keys:
            arrays = self.store.get(VOCABULARY, key)
            if arrays is None:
                break
            stored.append(arrays["words"])
        vocabulary = Vocabulary(Switches(**part(self.config, Switches)))
        descriptors = (self.features.load(frame).descriptors for frame in self.frames[: len(stored)])
        for _ in replay(vocabulary, zip(descriptors, stored, strict=True)):
            pass
        rest = list(zip(self.frames, self.keys, strict=True))[len(stored) :]
        for frame, key in progress(rest, len(rest), "vocabulary"):
            words = vocabulary.learn(self.features.load(frame).descriptors)
            self.store.put(VOCABULARY, key, {"words": words})
            stored.append(words)
        return BagOfWords(vocabulary, self._index(vocabulary, [vocabulary.held(words) for words in stored]))

    def _index(self, vocabulary: Vocabulary, words: list[NDArray[np.int32]]) -> InvertedFile | ObbDocuments:
        """Return the inverted file of all map images, or of their OBBs."""
        if self.config.document == "image":
            return InvertedFile(words, len(vocabulary))
        self.proposals.ensure(self.frames, "the map")
        inside = []
        for frame in progress(self.frames, len(self.frames), "OBBs of the map"):
            xyxy = self.proposals.of(frame).xyxy
            inside.append(keypoints_inside(xyxy, self.features.load(frame).xy))
        return ObbDocuments.post(words, inside, len(vocabulary))

    def kept(self) -> float:
        """Return the bytes per map image of all that localisation needs: words, postings, and what is verified."""
        kept = self.bag.nbytes
        if self.config.verify_top:
            kept += sum(f.xy.nbytes + f.descriptors.nbytes for f in map(self.features.load, self.frames))
        return kept / len(self.frames)

    def keypoints(self, frame: Frame) -> Features:
        """Return the keypoints of a query."""
        return self.features.load(frame)

    def placed_words(self, image: int) -> Features:
        """Return the words of a map image, as keypoints with their words' descriptors; those that were dropped are not.

        Nothing of the image itself is needed for it but which words were where.
        """
        words, xy = self.posted(image)
        return Features(xy, self.descriptors(words))

    def posted(self, image: int) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Return which words a map image holds, int32 [n] without those that were dropped, and where, [n, 2] pixels."""
        words = self._held(image)
        held = words != NO_WORD
        return words[held], self.features.load(self.frames[image]).xy[held]

    def descriptors(self, words: NDArray[np.int32]) -> NDArray[np.uint8]:
        """Return the descriptors of words, uint8 [n, 32]."""
        return self.bag.vocabulary.descriptors(words)

    def born(self, image: int) -> tuple[int, int]:
        """Return the words that a map image gave the vocabulary: the first id, and the one after the last."""
        return self.bag.vocabulary.born(image)

    def words_without(self, image: int, without: int) -> Features:
        """Return the words of a map image as they would be in a map without another one: for training alone.

        Where the word came from that other image, the keypoint is its own word: its descriptor is this image's own.
        """
        words = self._held(image)
        held = words != NO_WORD
        begin, end = self.born(without)
        own = self.features.load(self.frames[image])
        taken = ((begin <= words) & (words < end))[held]
        descriptors = np.where(taken[:, None], own.descriptors[held], self.descriptors(words[held]))
        return Features(own.xy[held], descriptors)

    def localize_without(self, image: Image, without: int) -> tuple[Features, Localization]:
        """Localise an image (uint8 RGB [H, W, 3]) in the map without one of its images, nor the words that it gave.

        Map ids are those of the whole map, and the one left out is in no list; idf is that of the whole map.
        """
        query = extract(image, self.config)
        words = self.bag.vocabulary.match(query.descriptors, leave=self.born(without))
        kept = np.delete(np.arange(len(self.frames)), without)
        found = localize(
            _Without(self.bag, without),
            self.library.boxes(image),
            query,
            words,
            self.config,
            lambda m: self._map_features(int(kept[m])),
        )
        ranks = np.insert(found.ranks, without, len(self.frames), axis=1)  # the last of all
        return query, replace(found, ranks=ranks, strong=kept[found.strong].astype(np.int32))

    def _held(self, image: int) -> NDArray[np.int32]:
        """Return the word of each keypoint of a map image, NO_WORD where it was dropped."""
        arrays = self.store.get(VOCABULARY, self.keys[image])
        if arrays is None:  # removed from the store, or damaged
            self._learn()
            arrays = self.store.get(VOCABULARY, self.keys[image])
            assert arrays is not None
        return self.bag.vocabulary.held(arrays["words"])

    def kept_places(self) -> float:
        """Return the bytes per map image of what ``placed_words`` needs beside the map: which words, and where."""
        return PLACED * self._held_words / len(self.frames)

    @cached_property
    def _held_words(self) -> int:
        """How many keypoints of all map images have a word; each image's are read for it, so once."""
        return sum(int(np.count_nonzero(self._held(image) != NO_WORD)) for image in range(len(self.frames)))

    def words(self, frame: Frame) -> NDArray[np.int32]:
        """Return the word of every keypoint of a query, int32 [n], NO_WORD where the ratio test fails."""
        return load(self.store, WORDS, self._words_key(frame), partial(self._match, frame))["words"]

    def _match(self, frame: Frame) -> Arrays:
        return {"words": self.bag.match(self.features.load(frame).descriptors)}

    def localize(self, queries: Sequence[Frame]) -> tuple[list[Key], list[Localization]]:
        """Localise every query by its OBBs.

        Returns:
            The addresses and the results, in the order of the queries.
        """
        keys = self._localization_keys(queries)
        missing = [q for q, key in zip(queries, keys, strict=True) if not self.store.has(LOCALIZATION, key)]
        if missing:
            self._localize_missing(missing, dict(zip(queries, keys, strict=True)))
        return keys, [self._load(key, frame) for key, frame in zip(keys, queries, strict=True)]

    def _localize_missing(self, missing: list[Frame], keys: dict[Frame, Key]) -> None:
        self.features.ensure(missing, "features of the queries")  # a damaged query is found before the map is learned
        self.proposals.ensure(missing, "the queries")
        _ = self.bag  # learned once here, before threads ask for it
        jobs = {self._words_key(frame): partial(self._match, frame) for frame in missing}
        ensure(self.store, WORDS, jobs, self.workers, "words of the queries")
        lists = {keys[frame]: partial(self._localize, frame) for frame in missing}
        ensure(self.store, LOCALIZATION, lists, self.workers, "localisation")

    def _words_key(self, frame: Frame) -> Key:
        return WORDS.key(part(self.config, Switches), [self.keys[-1], self.features.key(frame)])

    def _localize(self, frame: Frame) -> Arrays:
        boxes = self.proposals.of(frame)
        query = self.features.load(frame)
        found = localize(self.bag, boxes, query, self.words(frame), self.config, self._map_features)
        compact = np.uint16 if len(self.frames) < 1 << 16 else np.int32
        return {
            **_packed("boxes", found.boxes),
            **_packed("library", found.library),
            "ranks": found.ranks.astype(compact),
            "strong": found.strong,
        }

    def _map_features(self, image: int) -> Features:
        return self.features.load(self.frames[image])

    def _load(self, key: Key, frame: Frame) -> Localization:
        arrays = load(self.store, LOCALIZATION, key, partial(self._localize, frame))
        boxes, library = _unpacked("boxes", arrays), _unpacked("library", arrays)
        return Localization(boxes, arrays["ranks"], arrays["strong"], library)


def _packed(name: str, boxes: Boxes) -> Arrays:
    return {name: boxes.xyxy, f"{name}_source": np.frombuffer("+".join(boxes.source).encode(), np.uint8)}


def _unpacked(name: str, arrays: Arrays) -> Boxes:
    source = arrays[f"{name}_source"].tobytes().decode()
    return Boxes(arrays[name], tuple(source.split("+")) if source else ())
