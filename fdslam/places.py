"""Place classes: k-means over the map images, on their appearance, their position or their time (§AD).

The paper partitions the map into k place-classes by k-means and leaves open on what; the three kinds of vectors here
are the choices. The global descriptor is a histogram of oriented gradients: it looks at edges and not at intensities,
and every block is normalised, so a change of light moves it little.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist
from sklearn.cluster import KMeans
from threadpoolctl import threadpool_limits

from fdslam.errors import InputError
from fdslam.types import Image

SIDE = 128  # pixels; longer side of the image the gradients are taken from
GRID = 4  # cells along each side
BINS = 8  # orientations over half a turn: an edge and its negative fall into one bin
CLIP = 0.2  # largest share of one entry in a normalised block, as in Dalal and Triggs


def global_descriptor(image: Image) -> NDArray[np.float32]:
    """Describe a whole image by its oriented gradients (Dalal and Triggs 2005; global as in GIST; §AD).

    A grey copy of about ``SIDE`` pixels is cut into ``GRID`` × ``GRID`` cells. Every cell holds the gradient magnitude
    by orientation, shared linearly between the two nearest of ``BINS`` bins; every 2×2 block of cells is normalised to
    length one, clipped at ``CLIP`` and normalised again.

    Args:
        image: [H, W, 3] uint8 RGB.

    Returns:
        [(GRID - 1)² · 4 · BINS] float32 = [288], of non-negative entries; zeros for a blank image.

    Raises:
        InputError: not an RGB image of at least one pixel.
    """
    if image.ndim != 3 or image.shape[2] != 3 or image.size == 0:
        raise InputError(f"an RGB image [H, W, 3] is needed, this has the shape {image.shape}")
    scale = SIDE / max(image.shape[:2])
    # At least two pixels a cell, or the cells of a very long image would be empty.
    height, width = (max(2 * GRID, round(side * scale)) for side in image.shape[:2])
    small = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    grey = cv2.cvtColor(small, cv2.COLOR_RGB2GRAY).astype(np.float64)
    padded = np.pad(grey, 1, mode="edge")
    dx, dy = padded[1:-1, 2:] - padded[1:-1, :-2], padded[2:, 1:-1] - padded[:-2, 1:-1]
    position = np.arctan2(dy, dx) / np.pi * BINS  # of the orientation among the bins, modulo BINS
    low = np.floor(position)
    share, magnitude = position - low, np.hypot(dx, dy)
    cell = (np.arange(height) * GRID // height)[:, None] * GRID + (np.arange(width) * GRID // width)[None, :]
    histogram = np.zeros(GRID * GRID * BINS)
    for orientation, weight in ((low, 1 - share), (low + 1, share)):
        index = cell * BINS + orientation.astype(np.int64) % BINS
        histogram += np.bincount(index.ravel(), (magnitude * weight).ravel(), minlength=histogram.size)
    return _normalise_blocks(histogram.reshape(GRID, GRID, BINS))


def _normalise_blocks(cells: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the clipped L2 normalisation of every 2×2 block of ``cells`` [GRID, GRID, BINS], flattened."""
    corners = [cells[y : GRID - 1 + y, x : GRID - 1 + x] for y in (0, 1) for x in (0, 1)]
    blocks = np.concatenate(corners, axis=2)  # [GRID - 1, GRID - 1, 4 · BINS]
    for limit in (CLIP, np.inf):
        # The floor, half a grey level a block, keeps the noise of a blank wall from becoming a structure.
        blocks = np.minimum(blocks / np.maximum(np.linalg.norm(blocks, axis=2, keepdims=True), _floor(limit)), limit)
    return blocks.ravel().astype(np.float32)


def _floor(limit: float) -> float:
    """Return the smallest length a block is divided by: in grey levels first, then of a block already normalised."""
    return 0.5 if limit == CLIP else 1e-12


def pose_vectors(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the positions of map images as vectors for ``place_classes``; headings are left out.

    Args:
        poses: [M, 3] float64, x and y in metres, heading in radians.

    Returns:
        [M, 2] float64, metres.
    """
    return np.ascontiguousarray(poses[:, :2], dtype=np.float64)


def time_vectors(times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the positions along the path as vectors for ``place_classes``.

    Args:
        times: [M] float64, position along the session's path; drives lie far apart.

    Returns:
        [M, 1] float64.
    """
    return np.asarray(times, dtype=np.float64).reshape(-1, 1)


def nearest_places(vectors: NDArray[np.floating], label: NDArray[np.int64]) -> NDArray[np.int64]:
    """Put images that came later into the places of those that were partitioned: the one whose mean is nearest.

    Args:
        vectors: [M, d] one vector per map image, finite; those that were partitioned come first.
        label: [n] int64, the places of these, 0 … K - 1, every one in use.

    Returns:
        [M] int64, ``label`` and the places of the others; of places as near the first.
    """
    vectors = np.ascontiguousarray(vectors, dtype=np.float64)
    mean = np.stack([vectors[: len(label)][label == place].mean(axis=0) for place in range(label.max() + 1)])
    later = vectors[len(label) :]
    return np.concatenate([label, cdist(later, mean, "sqeuclidean").argmin(axis=1)])


def place_classes(vectors: NDArray[np.floating], k: int, seed: int) -> NDArray[np.int64]:
    """Partition the map images into at most ``k`` place-classes by k-means (§AD).

    Args:
        vectors: [M, d] one vector per map image, finite.
        k: the paper's k, at least 1; fewer where there are fewer distinct vectors.
        seed: of k-means++; the best of ten starts is taken.

    Returns:
        [M] int64, labels 0 … K-1, K <= min(k, distinct vectors), every one in use, numbered in the order in which they
        first appear along the map.

    Raises:
        InputError: no vectors, k below 1, or a vector that is not finite.
    """
    vectors = np.ascontiguousarray(vectors, dtype=np.float64)
    if vectors.ndim != 2 or len(vectors) == 0 or k < 1 or not np.isfinite(vectors).all():
        raise InputError(f"k-means needs k >= 1 and finite vectors [M, d]; k={k}, vectors {vectors.shape}")
    k = min(k, len(np.unique(vectors, axis=0)))
    # One thread: sums over images in another order would round differently, and a tie could fall the other way.
    with threadpool_limits(limits=1):
        found = KMeans(n_clusters=k, n_init=10, random_state=seed).fit_predict(vectors)
    _, first, inverse = np.unique(found, return_index=True, return_inverse=True)
    number = np.empty(len(first), dtype=np.int64)
    number[np.argsort(first)] = np.arange(len(first))  # also closes the gap of a class that k-means left empty
    return number[inverse]
