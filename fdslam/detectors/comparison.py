"""Pairwise comparison (PC): how far a query's local features are from those of the map images (§PC)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from fdslam.config import Comparison, part
from fdslam.context import Context, Detected, ensure
from fdslam.map_descriptors import FEATURES, MapDescriptors, extract, features, features_key
from fdslam.nearest import nearest_distance
from fdslam.store import Arrays, Key, Stage
from fdslam.types import CELL, Cells, Frame, grid_shape

STAGE = Stage("pc", ("fdslam.detectors.comparison",), ("numpy", "scipy"))


def keypoints_to_cells(
    xy: NDArray[np.float32], value: NDArray[np.float32], height: int, width: int, config: Comparison
) -> Cells:
    """Turn values at keypoints into the LoC of cells.

    - ``spread=cell``: the maximum in a cell, 0 where there is no keypoint.
    - ``gaussian``: that map blurred, cells outside the image counting as 0.
    - ``normalised``: the sum of the values in a cell, blurred, over the number of keypoints in it, blurred, plus
      ``spread_prior``: the mean of the keypoints around, which falls to 0 away from them. Of keypoints that are alike
      it says the same whether they are many or few; the two above only say where keypoints are.

    Args:
        xy: float32 ``[n, 2]`` pixels, inside the image.
        value: float32 ``[n]``, not negative.
        height: of the image, pixels.
        width: of the image, pixels.
        config: ``spread``; of the blur ``spread_sigma``, cells, and ``spread_prior``, keypoints a cell.

    Returns:
        float32 cells; they depend on no order.

    Raises:
        ValueError: a keypoint is outside the image, or a value is negative or not finite.

    Source: the paper's §PC is silent on how keypoints become pixels; the cells are those of its §Performance.
    """
    if not ((xy >= 0) & (xy < (width, height))).all():
        raise ValueError(f"a keypoint lies outside the image of {width} × {height} pixels")
    if not ((value >= 0) & (value < np.inf)).all():
        raise ValueError("a keypoint's value is negative or not finite")
    shape = grid_shape(height, width)
    column, row = (xy // CELL).astype(int).T
    blur = partial(gaussian_filter, sigma=config.spread_sigma, mode="constant")
    if config.spread == "normalised":
        cell, rising = row * shape[1] + column, np.argsort(value)  # by value: a sum depends on the order of its terms
        total = np.bincount(cell[rising], value[rising], math.prod(shape)).reshape(shape)
        number = np.bincount(cell, minlength=math.prod(shape)).reshape(shape).astype(float)
        return (blur(total) / (blur(number) + config.spread_prior)).astype(np.float32)
    cells = np.zeros(shape, np.float32)
    np.maximum.at(cells, (row, column), value)
    return blur(cells) if config.spread == "gaussian" else cells


def _keys(context: Context) -> list[Key]:
    data, config, kept = context.dataset, context.config.pc, MapDescriptors(context)
    return [
        STAGE.key(part(config, Comparison), [features_key(frame, config), *map(kept.key, hypotheses)])
        for frame, hypotheses in zip(data.query, context.hypotheses, strict=True)
    ]


def _needed(context: Context, keys: Sequence[Key], lacks: Callable[[Key], bool]) -> list[Frame]:
    """Return the frames whose SIFTs the queries without a result need."""
    data = context.dataset
    queries = [query for query, key in enumerate(keys) if lacks(key)]
    compared = [f for q in queries for f in (data.query[q], *(data.map[m] for m in context.hypotheses[q]))]
    return [*dict.fromkeys([*compared, *(MapDescriptors(context).teachers if queries else [])])]


def missing(context: Context) -> tuple[int, set[Key]]:
    """Count the queries without a stored result; also return the addresses of the SIFTs that are missing for them."""
    keys, store = _keys(context), context.store
    needed = _needed(context, keys, lambda key: bool(store.lacks(STAGE, [key])))
    sifts = {features_key(frame, context.config.pc) for frame in needed}
    return store.lacks(STAGE, keys), {key for key in sifts if store.lacks(FEATURES, [key])}


def prepare(context: Context) -> None:
    """Make and read the descriptors of all map images."""
    frames, config, kept = context.dataset.map, context.config, MapDescriptors(context)
    jobs = {features_key(frame, config.pc): partial(extract, frame, config.pc) for frame in frames}
    ensure(context.store, FEATURES, jobs, config.workers, "PC features")
    for image in range(len(frames)):
        kept.of(image)


def detect(context: Context) -> Detected:
    """Return the LoC of every query (§PC): the distance of its SIFTs to the nearest of the top-Y map images.

    The map images' descriptors are kept for this: it is the one detector that stores features of the map. How much is
    the mean over those that were compared with.
    """
    data, config, kept = context.dataset, context.config.pc, MapDescriptors(context)

    def cells(query: int) -> Arrays:
        frame = data.query[query]
        if not len(context.hypotheses[query]):  # its place is not in the map: nothing to compare with
            return {"loc": np.zeros(grid_shape(frame.height, frame.width), np.float32)}
        own = features(context, frame)
        distance = nearest_distance(own["sift"], [kept.of(m) for m in context.hypotheses[query]], config.threads)
        return {"loc": keypoints_to_cells(own["xy"], distance, frame.height, frame.width, config)}

    keys = _keys(context)
    needed = _needed(context, keys, lambda key: not context.store.has(STAGE, key))
    jobs = {features_key(frame, config): partial(extract, frame, config) for frame in needed}
    ensure(context.store, FEATURES, jobs, context.config.workers, "PC features")
    if kept.coded and needed:
        _ = kept.codebook  # trained once here, before threads ask for it
    loc = [arrays["loc"] for arrays in context.fetch(STAGE, keys, cells, "PC")]
    compared = sorted({int(m) for hypotheses in context.hypotheses for m in hypotheses})
    return Detected(loc, kept.kept(compared))
