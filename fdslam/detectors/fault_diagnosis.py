"""Fault diagnosis (FD): where weak and strong self-localisation disagree, something has changed (§FD, Eq. 1).

For a strong hypothesis m_y each pixel p gets r^(y)[p] = |J[p]| (Σ_{j∈J[p]} 1 / r_j(m_y))⁻¹, the harmonic mean of the
ranks that the OBBs containing p give to m_y; then the minimum over the top-Y hypotheses. A pixel in no OBB gets 0.

Beyond the paper, as switches: other means of the ranks r, with weights; cells far from all keypoints, of which the bag
of words knows nothing, get the lowest LoC (``fd.gate``); and with ``fd.support`` the words speak for themselves too:
LoC = 1 + ln r / ln M + support · u, with u the share of the keypoints around a cell that no word of the map supports.

Weighted sums are fixed-point integers: the order of the OBBs cannot change a result.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from fdslam.config import Fd, Pc, part
from fdslam.context import Context, Detected
from fdslam.coverage import Coverage
from fdslam.detectors.comparison import keypoints_to_cells
from fdslam.detectors.support import missing as missing_support
from fdslam.detectors.support import word_support
from fdslam.localization import RECIPROCAL_ONE
from fdslam.store import Arrays, Key, Stage
from fdslam.types import CELL, Cells, grid_shape

STAGE = Stage("fd", ("fdslam.detectors.fault_diagnosis",), ("numpy", "scipy"))
RANK_ONE = 1 << 30  # fixed-point 1.0 of a rank, of its logarithm, and of a weight beside them
PRIOR = 0.4  # keypoints a cell: where there are fewer around, their word counts for less
POOL: dict[str, Callable[..., NDArray]] = {"min": np.min, "mean": np.mean, "max": np.max, "median": np.median}
Paint = Callable[[NDArray[np.int64]], NDArray[np.int64]]


def _fixed(values: NDArray, one: int) -> NDArray[np.int64]:
    return np.rint(one * values).astype(np.int64)


def _mean_rank(ranks: NDArray, weights: NDArray[np.float64], paint: Paint, mean: str) -> NDArray[np.float64]:
    """Mean over J[p] of ranks [..., J] with weights [J] of at most 1, on the edge grid; 0 where no box covers."""
    if mean == "harmonic":
        above, below = paint(_fixed(weights, RECIPROCAL_ONE)), paint(_fixed(weights / ranks, RECIPROCAL_ONE))
    else:  # pooled first, a rank need not be whole
        values = np.log(ranks) if mean == "geometric" else ranks
        above, below = paint(_fixed(weights * values, RANK_ONE)), paint(_fixed(weights, RANK_ONE))
    shape = np.broadcast_shapes(above.shape, below.shape)
    covered = np.broadcast_to((above if mean == "harmonic" else below) > 0, shape)
    found = np.divide(above, below, out=np.zeros(shape), where=covered)
    return np.exp(found, out=np.zeros(shape), where=covered) if mean == "geometric" else found


def _weights(boxes: NDArray[np.float32], config: Fd) -> NDArray[np.float64]:
    """Return the weights of the OBBs in the mean, the largest 1: float64 [J]."""
    if config.weights == "equal" or not len(boxes):
        return np.ones(len(boxes))
    sides = boxes[:, 2:].astype(np.float64) - boxes[:, :2]
    area = np.maximum(sides.prod(axis=1), CELL**2)  # a box within a cell is as good as the cell
    return area.min() / area


def _blocks(
    coverage: Coverage, boxes: NDArray[np.float32], ranks: NDArray[np.int32], config: Fd
) -> NDArray[np.float64]:
    """Return the mean ranks on the blocks of the coverage."""
    if ranks.size == 0:  # no OBB that says anything, or no hypothesis to disagree with
        return np.zeros(coverage.paint(np.zeros(len(ranks), np.int64)).shape)
    pool, weights = POOL[config.pooling], _weights(boxes, config)
    if config.order == "fuse_then_pool":
        return pool(_mean_rank(ranks.T, weights, coverage.paint, config.mean), axis=0)
    return _mean_rank(pool(ranks, axis=1), weights, coverage.paint, config.mean)


def loc_pixels(
    boxes: NDArray[np.float32], ranks: NDArray[np.int32], height: int, width: int, config: Fd
) -> NDArray[np.float32]:
    """Return the LoC of every pixel by the ranks alone.

    Args:
        boxes: float32 [J, 4] xyxy pixels, half-open: the OBBs.
        ranks: int32 [J, Y], r_j(m_y): the rank that weak list j gives to each of the top-Y strong hypotheses.
        height: of the image, pixels.
        width: of the image, pixels.
        config: pooling, order, mean, weights.

    Returns:
        float32 [height, width], 1 … M inside any OBB, 0 outside all.
    """
    coverage = Coverage(boxes, height, width)
    return coverage.pixels(_blocks(coverage, boxes, ranks, config)).astype(np.float32)


def loc_cells(boxes: NDArray[np.float32], ranks: NDArray[np.int32], height: int, width: int, config: Fd) -> Cells:
    """Return the LoC of every cell by the ranks alone, the maximum of its pixels; arguments as ``loc_pixels``."""
    coverage = Coverage(boxes, height, width)
    return coverage.cells(_blocks(coverage, boxes, ranks, config)).astype(np.float32)


def near_keypoints(xy: NDArray[np.float32], height: int, width: int, reach: int) -> NDArray[np.bool_]:
    """Tell which cells have a keypoint (float32 [n, 2] pixels) at most ``reach`` rows and columns away."""
    cells = np.zeros(grid_shape(height, width), bool)
    column, row = (xy // CELL).astype(int).T
    cells[row, column] = True
    return maximum_filter(cells, 2 * reach + 1, mode="constant")


def unsupported(xy: NDArray[np.float32], distance: NDArray[np.integer], height: int, width: int, config: Fd) -> Cells:
    """Return the share u of the keypoints around each cell that no word of the map supports.

    Args:
        xy: float32 [n, 2] pixels.
        distance: int [n] bits, of each keypoint to the nearest word where it should be seen.
        height: of the image, pixels.
        width: of the image, pixels.
        config: ``support_distance`` and ``support_sigma``.

    Returns:
        float32 cells, 0 … 1; it falls to 0 away from keypoints.
    """
    alone = (distance > config.support_distance).astype(np.float32)
    spread = Pc(spread="normalised", spread_sigma=config.support_sigma, spread_prior=PRIOR)
    return keypoints_to_cells(xy, alone, height, width, spread)


def with_support(ranks: Cells, share: Cells, images: int, config: Fd) -> Cells:
    """Return 1 + ln r / ln M + support · u for mean ranks r of cells in any OBB, 0 elsewhere; M: ``images``."""
    level = np.log(np.maximum(ranks, 1)) / math.log(max(images, 2))
    return np.where(ranks > 0, 1 + level + config.support * share, 0).astype(np.float32)


def _keys(context: Context) -> list[Key]:
    return [
        STAGE.key(part(context.config.fd, Fd), [key, *map(str, hypotheses)])
        for key, hypotheses in zip(context.localization_keys, context.hypotheses, strict=True)
    ]


def missing(context: Context) -> tuple[int, set[Key]]:
    """Count the queries without a stored result; also return the addresses of the word support missing for them."""
    keys = _keys(context)
    lacking = context.store.lacks(STAGE, keys)
    return lacking, missing_support(context) if lacking and context.config.fd.support else set()


def prepare(context: Context) -> None:
    """Make and read what FD keeps of the map beside its words: nothing, or with ``fd.support`` where they are."""
    if context.config.fd.support:
        assert context.bow is not None  # the pipeline gives it
        context.bow.kept_places()


def detect(context: Context) -> Detected:
    """Return the LoC of every query (§FD) from its weak ranks of the hypotheses.

    Nothing more of the map is kept for it than its bag of words or, with ``fd.support``, where in the images words are.
    """
    data, config, bow = context.dataset, context.config.fd, context.bow
    keys = _keys(context)
    looked = bool(config.support) and any(not context.store.has(STAGE, key) for key in keys)
    distance = word_support(context) if looked else []

    def cells(query: int) -> Arrays:
        frame, found = data.query[query], context.localizations[query]
        ranks = found.ranks[:, context.hypotheses[query]].astype(np.int32)
        size = frame.height, frame.width
        loc = loc_cells(found.boxes.xyxy, ranks, *size, config)
        if config.support or config.gate:
            assert bow is not None  # the pipeline gives it
            xy = bow.keypoints(frame).xy
            if config.support:
                bits = (distance or word_support(context))[query]
                loc = with_support(loc, unsupported(xy, bits, *size, config), len(data.map), config)
            if config.gate:
                loc[~near_keypoints(xy, *size, config.gate)] = 0
        return {"loc": loc}

    loc = [arrays["loc"] for arrays in context.fetch(STAGE, keys, cells, "FD")]
    return Detected(loc, bow.kept_places() if config.support and bow else 0.0)
