"""A query laid over the map images of its place, by the keypoints whose words the bag of words holds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fdslam.bow.verification import best_supported
from fdslam.compact.flow import Flow, flow
from fdslam.config import Alignment
from fdslam.types import Features

LEAST = 8  # agreeing keypoints that make an alignment


@dataclass(frozen=True)
class Aligned:
    """A map image and what of it agrees with the query as one rigid scene."""

    image: int  # map id
    other: Features  # its words, and where they are
    here: NDArray[np.float32]  # [k, 2] pixels of the query
    there: NDArray[np.float32]  # [k, 2] pixels of the map image
    size: tuple[int, int]  # height and width of the query, pixels
    other_size: tuple[int, int]  # likewise of the map image

    @cached_property
    def to_map(self) -> Flow:
        """Where points of the query should be seen in the map image."""
        return flow(self.here, self.there, *self.size)

    @cached_property
    def to_query(self) -> Flow:
        """Where points of the map image should be seen in the query."""
        return flow(self.there, self.here, *self.other_size)


def align(
    query: Features,
    size: tuple[int, int],
    images: Sequence[int],
    words: Callable[[int], Features],
    sizes: Callable[[int], tuple[int, int]],
    config: Alignment,
) -> list[Aligned]:
    """Return the map images that agree best with a query, those with most agreeing keypoints first.

    Args:
        query: its keypoints.
        size: its height and width, pixels.
        images: map ids that are matched with it, distinct.
        words: from a map id to the words of that image and their places.
        sizes: from a map id to that image's height and width, pixels.
        config: how many are returned at most.
    """
    return [
        Aligned(one.image, one.other, query.xy[one.mine], one.other.xy[one.theirs], size, sizes(one.image))
        for one in best_supported(query, images, words, LEAST, config.images)
        if len(one.mine)
    ]
