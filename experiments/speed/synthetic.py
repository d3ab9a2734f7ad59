"""Synthetic maps of any size, with the words of real images and their popularity.

New words come as fast as they do in a real map of photographs (Heaps' law, fitted to the table of
``experiments.speed.localization``: V(M) = 2.65 million · (M / 3000) ^ 0.827). A keypoint that is no new word repeats an
earlier posting drawn at random, so that what was seen often is seen again more often (Simon's process, which gives the
power law of real word counts). The bits of a new word are those of a real one with an eighth of them flipped: new words
crowd where real ones do. A sighting of a word has a thirty-second of its bits flipped.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.types import Features

WORDS_AT_3000, EXPONENT = 2.65e6, 0.827


def flipped(words: NDArray[np.uint8], halvings: int, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return the words (uint8 [n, 32]) with each bit flipped with probability 2 ** -halvings."""
    noise = rng.integers(0, 256, words.shape, dtype=np.uint8)
    for _ in range(halvings - 1):
        noise &= rng.integers(0, 256, words.shape, dtype=np.uint8)
    return words ^ noise


def vocabulary_size(images: int) -> int:
    """Return V(M)."""
    return round(WORDS_AT_3000 * (images / 3000) ** EXPONENT)


@dataclass
class Synthetic:
    """A map that grows block by block; what is drawn depends on the seed and the blocks so far."""

    real: NDArray[np.uint8]  # [n, 32] words of real images
    keypoints: int  # of an image
    rng: np.random.Generator

    def __post_init__(self) -> None:
        """Start empty."""
        self.images = 0
        self._postings: list[NDArray[np.int32]] = []  # of blocks of images, [images, keypoints]

    @classmethod
    def after(cls, real: NDArray[np.uint8], posted: list[NDArray[np.int32]], rng: np.random.Generator) -> Synthetic:
        """Return what goes on from a real map.

        Args:
            real: uint8 [n, 32], its words.
            posted: int32 [k] of each of its images, their words.
            rng: decides everything.
        """
        world = cls(real, max(map(len, posted)), rng)
        world.images, world._postings = len(posted), [words[None] for words in posted if len(words)]
        return world

    def new_words(self, count: int) -> NDArray[np.uint8]:
        """Return bits of new words, uint8 [count, 32]."""
        return flipped(self.real[self.rng.integers(0, len(self.real), count)], 3, self.rng)

    def _seen(self, count: int) -> NDArray[np.int32]:
        """Return the words of ``count`` earlier postings drawn at random, int32 [count]."""
        block = self.rng.integers(0, sum(map(len, self._postings)), count)
        ends = np.cumsum([len(one) for one in self._postings])
        which = np.searchsorted(ends, block, side="right")
        found = np.empty(count, np.int32)
        for i, one in enumerate(self._postings):
            mine = np.flatnonzero(which == i)
            found[mine] = one.reshape(-1)[self.rng.integers(0, one.size, len(mine))]
        return found

    def block(self, images: int, known: int) -> tuple[NDArray[np.uint8], list[NDArray[np.int32]]]:
        """Return the bits of the new words of the next images, uint8 [n, 32], and every image's words, int32 [k].

        New words get the ids from ``known`` on.
        """
        total = images * self.keypoints
        new = min(vocabulary_size(self.images + images) - vocabulary_size(self.images), total)
        words = np.arange(known, known + new, dtype=np.int32)
        repeated = self._seen(total - new) if self._postings else self.rng.choice(words, total - new)
        mixed = self.rng.permutation(np.concatenate([words, repeated])).reshape(images, self.keypoints)
        self._postings.append(mixed)
        self.images += images
        return self.new_words(new), list(mixed)

    def view(self, words: NDArray[np.uint8]) -> Features:
        """Return an image as the next one of the map would be: some keypoints new, the others seen before.

        Args:
            words: uint8 [V, 32], the bits of all words so far.
        """
        share = EXPONENT * vocabulary_size(self.images) / self.images / self.keypoints  # V′(M) per keypoint
        new = min(round(share * self.keypoints), self.keypoints)
        seen = flipped(words[self._seen(self.keypoints - new)], 5, self.rng)
        bits = self.rng.permutation(np.concatenate([self.new_words(new), seen]))
        return Features(self.rng.uniform(0, 1, (self.keypoints, 2)).astype(np.float32) * [640, 480], bits)
