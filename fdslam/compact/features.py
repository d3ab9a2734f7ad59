"""What early fusion looks at: the evidence of each cell, how it stands out in its image, and its surroundings.

Neither where the cell is nor what a detector of objects says: a fixed blob or objectness cannot be learned from these.
Nor anything that is the same for the whole image, as how many keypoints agree: with as few images as a map has, a learner
takes such numbers for the images themselves.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from fdslam.store import Arrays
from fdslam.types import Cells

MAPS = ("fine", "coarse", "fine alone", "coarse alone", "words", "missing", "FD")
KNOWN = ("texture", "near", "wide")  # how much there is to go by
SURROUNDINGS = (1.2, 3.0)  # σ, cells
NAMES = (
    *(f"{name} {form}" for name in MAPS for form in ("raw", "normalised", *(f"σ {s}" for s in SURROUNDINGS))),
    *(f"{name} {form}" for name in KNOWN for form in ("raw", f"σ {SURROUNDINGS[-1]}")),
)


def fd_level(ranks: Cells, images: int) -> Cells:
    """Return ln r / ln M of FD's mean ranks, 0 … 1, and 0 where there are none: maps of any size then look alike."""
    return (np.log(np.maximum(ranks, 1)) / math.log(max(images, 2))).astype(np.float32)


def features(evidence: Arrays, fd: Cells) -> NDArray[np.float32]:
    """Return the features of every cell of an image, row by row.

    Args:
        evidence: of ``compact.evidence``.
        fd: ``fd_level``, [rows, cols].

    Returns:
        float32 [rows · cols, len(NAMES)], finite.
    """
    found = []
    for name in MAPS:
        cells = fd if name == "FD" else evidence[name]
        middle = float(np.median(cells))
        spread = float(np.abs(cells - middle).mean()) + 1e-6
        found += [cells, (cells - middle) / spread, *(gaussian_filter(cells, s) for s in SURROUNDINGS)]
    for name in KNOWN:
        found += [evidence[name], gaussian_filter(evidence[name], SURROUNDINGS[-1])]
    return np.stack(found, axis=-1).reshape(-1, len(NAMES)).astype(np.float32)
