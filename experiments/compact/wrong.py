"""Maps of another place: what is left of a detector then is not knowledge of the map."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from experiments.compact.prepared import Prepared
from fdslam.compact.alignment import Aligned
from fdslam.compact.evidence import evidence
from fdslam.compact.grid import Grid
from fdslam.context import Context
from fdslam.metrics.seeds import generator
from fdslam.store import Arrays

FAR = 10  # map images along the path: at most so far is not another place


def places(context: Context) -> list[NDArray[np.int64]]:
    """Return the map ids of every query's place: the true ones, and those where it was localised."""
    data = context.dataset
    true = data.relevant or (np.zeros(0, np.int64),) * len(data.query)
    return [np.union1d(one, best[:1]) for one, best in zip(true, context.hypotheses, strict=True)]


def far_images(place: NDArray[np.int64], images: int, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return up to ``count`` random map ids, each more than ``FAR`` ids away from every one of a place.

    Args:
        place: map ids, rising.
        images: of the map.
        count: how many are wanted.
        rng: decides which.
    """
    every = np.arange(images)
    far = every[np.abs(every[:, None] - place[None]).min(axis=1, initial=images) > FAR]
    return rng.choice(far, min(count, len(far)), replace=False).astype(np.int64)


def far_hypotheses(context: Context) -> list[NDArray[np.int64]]:
    """Return random map images of other places for every query, as many as it has hypotheses."""
    data, seed = context.dataset, context.config.seed
    return [
        far_images(place, len(data.map), len(best), generator(seed, "wrong map", frame.name))
        for place, best, frame in zip(places(context), context.hypotheses, data.query, strict=True)
    ]


def unmoved(size: tuple[int, int], other_size: tuple[int, int]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return points of a query, [k, 2] pixels, and the same points of a map image: one laid over the other whole."""
    here = Grid(12, 16, size[0] / 12, size[1] / 16).centres().astype(np.float32)
    scale = np.array([other_size[1] / size[1], other_size[0] / size[0]], np.float32)
    return here, here * scale


def laid_over(ready: Prepared, wrong: Sequence[NDArray[np.int64]]) -> list[Arrays]:
    """Return every query's evidence against the first of ``wrong``, laid over it whole as if keypoints agreed.

    Where a wrong image does not align, nothing is compared at all; here something is.
    """
    context, config = ready.context, ready.context.config.compact
    data, bow = context.dataset, context.bow
    assert bow is not None
    found = []
    for frame, images in zip(data.query, wrong, strict=True):
        size = frame.height, frame.width
        aligned = []
        for m in images[: config.images].tolist():
            theirs = ready.kept.size(m)
            aligned.append(Aligned(m, ready.kept.words(m), *unmoved(size, theirs), size, theirs))
        seen = ready.kept.looks(frame)
        found.append(
            evidence(bow.keypoints(frame), seen, size, aligned, lambda m: ready.kept.looks(data.map[m]), config)
        )
    return found
