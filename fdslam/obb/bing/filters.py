"""What training leaves of BING: the 8 × 8 filter of stage I and, for each window size, the line of stage II.

Our own format is one safetensors file with any number of colour spaces and a checksum; the published filters are
read by published.py.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from fdslam.errors import InputError
from fdslam.obb.bing.binary import SIDE
from fdslam.obb.bing.gradient import SPACES
from fdslam.store import write_atomically

LENGTHS = (16, 32, 64, 128, 256, 512)  # pixels
SIZES = tuple(product(LENGTHS, LENGTHS))  # (height, width) of the windows, in the order of the published indices
SUFFIX = ".safetensors"
_KIND = "fdslam.bing"


@dataclass(frozen=True, eq=False)
class Filters:
    """Both stages in one colour space."""

    space: str  # one of SPACES
    first: NDArray[np.float32]  # [8, 8] w of stage I
    sizes: NDArray[np.int32]  # [n] the active window sizes, ascending indices into SIZES
    second: NDArray[np.float32]  # [n, 2] v and t of stage II, o = s · v + t

    def __post_init__(self) -> None:
        """Raise InputError if the arrays cannot be filters."""
        if self.space not in SPACES:
            raise InputError(f"BING filters of the colour space {self.space!r}; known are {', '.join(SPACES)}")
        if self.first.shape != (SIDE, SIDE) or not np.isfinite(self.first).all() or not self.first.any():
            raise InputError(f"BING filters: stage I must be {SIDE}×{SIDE} numbers, not all zero")
        if self.sizes.ndim != 1 or not len(self.sizes) or (np.diff(self.sizes) <= 0).any():
            raise InputError("BING filters: the window sizes must be ascending indices, at least one")
        if self.sizes.min() < 0 or self.sizes.max() >= len(SIZES):
            raise InputError(f"BING filters: indices of window sizes go from 0 to {len(SIZES) - 1}")
        if self.second.shape != (len(self.sizes), 2) or not np.isfinite(self.second).all():
            raise InputError(f"BING filters: stage II must be two numbers for each of the {len(self.sizes)} sizes")


def digest(filters: Sequence[Filters]) -> str:
    """Return the sha256 of filters' content, in hex: the same filters have it in every format."""
    total = hashlib.sha256()
    for one in filters:
        total.update(one.space.encode())
        for array, kind in ((one.first, "<f4"), (one.sizes, "<i4"), (one.second, "<f4")):
            total.update(str(array.shape).encode() + array.astype(kind).tobytes())
    return total.hexdigest()


def save_filters(path: Path, filters: Sequence[Filters]) -> None:
    """Write filters, one or more colour spaces, to one safetensors file.

    Raises:
        InputError: no filters, a colour space twice, or the disk refuses.
    """
    _check(filters)
    arrays = {
        f"{one.space}.{name}": np.ascontiguousarray(getattr(one, name))
        for one in filters
        for name in ("first", "sizes", "second")
    }
    about = {"spaces": [one.space for one in filters], "sha256": digest(filters)}
    # One entry: safetensors writes several in any order, and the same filters shall make the same file.
    write_atomically(path, save(arrays, metadata={_KIND: json.dumps(about)}))


def read_own(path: Path) -> tuple[Filters, ...]:
    """Read what ``save_filters`` wrote.

    Raises:
        InputError: no such file, another file, or a damaged one.
    """
    try:
        with safe_open(path, framework="numpy") as file:
            kept = (file.metadata() or {}).get(_KIND)
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a mapping
    except FileNotFoundError:
        raise InputError(f"{path}: no such file of BING filters; check the path") from None
    except (OSError, SafetensorError) as error:
        raise InputError(f"{path}: cannot be read as safetensors ({error}); copy or train the filters again") from None
    if kept is None:
        raise InputError(
            f"{path}: a safetensors file, but not of BING filters; train some with experiments/train/bing.py"
        )
    try:
        about = json.loads(kept)
        filters = tuple(
            Filters(space, *(arrays[f"{space}.{name}"] for name in ("first", "sizes", "second")))
            for space in about["spaces"]
        )
    except (KeyError, TypeError, ValueError, InputError) as error:
        raise InputError(
            f"{path}: lacks a part or holds a wrong one ({error}); copy or train the filters again"
        ) from None
    if digest(filters) != about.get("sha256"):
        raise InputError(f"{path}: damaged, its checksum is wrong; copy or train the filters again")
    return filters


def _check(filters: Sequence[Filters]) -> None:
    spaces = [one.space for one in filters]
    if not spaces or len(set(spaces)) < len(spaces):
        raise InputError(f"BING filters: each colour space once, at least one; given are {', '.join(spaces) or 'none'}")
