"""Word support: has a keypoint of the query a word of the map at about the place where it should be seen?

An image of the map is known by its words and their places alone. The best hypotheses and their neighbours along the
path are matched with the query and verified as one rigid scene; those with most agreeing keypoints are aligned with it,
and each keypoint of the query looks for the word most like it around its predicted place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from fdslam.bow.alignment import predicted
from fdslam.bow.around import NONE, candidates, nearest_around
from fdslam.bow.verification import best_supported
from fdslam.config import Support, part
from fdslam.context import Context
from fdslam.store import Arrays, Key, Stage
from fdslam.types import Features

STAGE = Stage(
    "word_support",
    ("fdslam.detectors.support", "fdslam.mapping"),
    ("opencv-python-headless", "numpy", "scipy"),
)
HYPOTHESES, NEIGHBOURS = 3, 1  # the best of the strong list, and images before and after each along the path
LEAST = 8  # agreeing keypoints that verify an image


def support(
    query: Features, side: float, images: Sequence[int], words: Callable[[int], Features], config: Support
) -> NDArray[np.int64]:
    """Return how far the nearest word is that the map has for each keypoint of a query.

    Args:
        query: n keypoints.
        side: √(height · width) of the query, pixels.
        images: map ids that are matched with it, distinct.
        words: from a map id to the words of that image and their places.
        config: how many images are looked at, and how far around the predicted place.

    Returns:
        int64 [n] bits, the smallest over the images; NONE where there is no word.
    """
    best = np.full(len(query.xy), NONE)
    for one in best_supported(query, images, words, LEAST, config.support_images):
        at = predicted(query.xy, query.xy[one.mine], one.other.xy[one.theirs], side)
        found = nearest_around(query.descriptors, at, one.other, config.support_radius / 100 * side)
        np.minimum(best, found, out=best)
    return best


def _keys(context: Context) -> list[Key]:
    settings = part(context.config.fd, Support)
    return [
        STAGE.key(settings, [key, *map(str, hypotheses[:HYPOTHESES])])
        for key, hypotheses in zip(context.localization_keys, context.hypotheses, strict=True)
    ]


def missing(context: Context) -> set[Key]:
    """Return the addresses of the queries' word support that are not stored."""
    return {key for key in _keys(context) if context.store.lacks(STAGE, [key])}


def word_support(context: Context) -> list[NDArray[np.int64]]:
    """Return for every query how far the nearest word is that the map has for each keypoint, int64 [n] bits."""
    data, bow = context.dataset, context.bow
    assert bow is not None  # the pipeline gives it

    def look(query: int) -> Arrays:
        frame = data.query[query]
        images = candidates(context.hypotheses[query], len(data.map), HYPOTHESES, NEIGHBOURS)
        side = float(np.sqrt(frame.height * frame.width))
        distance = support(bow.keypoints(frame), side, images, bow.placed_words, context.config.fd)
        return {"distance": distance.astype(np.uint16)}

    found = context.fetch(STAGE, _keys(context), look, "word support")
    return [arrays["distance"].astype(np.int64) for arrays in found]
