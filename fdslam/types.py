"""What flows between the stages. Frozen; every field gives its shape, dtype and unit.

Conventions, stated once:
- images are uint8 RGB ``[H, W, 3]``; pixel (x, y) is the unit square with that integer corner, so a keypoint at the
  centre of the first pixel is at (0.5, 0.5);
- boxes are ``xyxy`` float32 in pixels, half-open: pixel x belongs to a box when ``x0 <= x < x1``;
- LoC (likelihood of change) is float32, larger means more likely changed, never NaN;
- cells are squares of ``CELL`` pixels (partial at the right and lower border): ``[ceil(H/CELL), ceil(W/CELL)]``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

CELL = 10  # pixels; the grid of §Performance
LABELS = ("sky", "ground", "building", "vegetation", "object")  # label images hold indices into this tuple

Image = NDArray[np.uint8]  # [H, W, 3] RGB
Cells = NDArray[np.float32]  # [ceil(H/CELL), ceil(W/CELL)] LoC


def grid_shape(height: int, width: int) -> tuple[int, int]:
    """Return (rows, columns) of the cell grid of an image of ``height`` × ``width`` pixels."""
    return -(-height // CELL), -(-width // CELL)


@dataclass(frozen=True)
class Frame:
    """One image of a session, not yet decoded."""

    name: str  # path inside the data set, e.g. "query/0001.jpg": unique
    path: Path
    digest: str  # sha256 of the file's bytes
    height: int  # pixels
    width: int  # pixels


@dataclass(frozen=True)
class Dataset:
    """A map session, a query session and what is known to be true of them."""

    name: str  # of the data set, the same for all its pairs
    map: tuple[Frame, ...]  # in the order of the path: map id m is the position in this tuple
    query: tuple[Frame, ...]
    boxes: tuple[NDArray[np.float32], ...] | None  # per query [n, 4] xyxy of changed objects; None: not annotated
    relevant: tuple[NDArray[np.int64], ...] | None  # per query the map ids of its place, nearest first; None: unknown
    labels: tuple[Path | None, ...] | None  # per query a label image (uint8 [H, W], indices into LABELS)
    poses: NDArray[np.float64] | None  # [M, 3] x, y in metres and heading in radians of the map images
    times: NDArray[np.float64]  # [M] position along the session's path; drives lie far apart
    pair: tuple[str, str] | None = None  # (query session, map session), where the data set has several sessions


@dataclass(frozen=True)
class Features:
    """Local features of one image."""

    xy: NDArray[np.float32]  # [n, 2] pixels of the original image, corner convention
    descriptors: NDArray[np.uint8]  # [n, 32] ORB, 256 bit packed


@dataclass(frozen=True)
class Boxes:
    """Object bounding boxes (OBBs) of one image."""

    xyxy: NDArray[np.float32]  # [J, 4] pixels, half-open
    source: tuple[str, ...]  # [J] name of the part of the library that made each, e.g. "J"


@dataclass(frozen=True)
class Localization:
    """Weak and strong self-localisation of one query (§FD)."""

    boxes: Boxes  # the J OBBs that hold enough keypoints to say anything
    ranks: NDArray[np.integer]  # [J, M] r_j(m): rank of every map image in every weak list, 1 = best
    strong: NDArray[np.int32]  # [M] map ids by falling relevance: the strong list
    library: Boxes  # all OBBs of the library, those included that say nothing

    @property
    def lost(self) -> bool:
        """Whether no weak list tells one map image from another: the strong list is then in the order of the ids."""
        return bool((self.ranks == self.ranks[:, :1]).all()) and self.ranks.shape[1] > 1
