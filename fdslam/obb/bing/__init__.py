"""BING: unsupervised proposals of object boxes from binarized normed gradients (Cheng et al., CVPR 2014)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fdslam.errors import InputError
from fdslam.obb.bing.filters import SUFFIX, Filters, digest, read_own, save_filters
from fdslam.obb.bing.proposals import proposals
from fdslam.obb.bing.published import published_files, published_prefixes, read_published

__all__ = [
    "COUNT",
    "OWN",
    "Filters",
    "bing_boxes",
    "digest",
    "load_filters",
    "own_filters",
    "proposals",
    "save_filters",
]
COUNT = 50  # boxes an image gives: the paper's best 42–50
OWN = Path(__file__).parents[2] / "weights" / "bing_campus.safetensors"  # trained on the embedded world, see the .md


def load_filters(path: str | Path) -> tuple[Filters, ...]:
    """Return filters from a file of ours, or from the published files.

    Args:
        path: our safetensors file; or the prefix of three published files, ``DIR/ObjNessB2W8MAXBGR``; or the folder
            with the published files of one or several colour spaces.

    Raises:
        InputError: nothing of the kind there, or a file that is missing, damaged or something else.
    """
    where = Path(path).expanduser()
    if where.is_dir():
        prefixes = published_prefixes(where)
        if not prefixes:
            raise InputError(f"{where}: holds no BING filters (*.wS1.yml.gz, *.wS2.yml.gz, *.idx.yml.gz)")
        return tuple(read_published(prefix) for prefix in prefixes)
    if where.suffix == SUFFIX:
        return read_own(where)
    if not any(file.is_file() for file in published_files(where)):
        raise InputError(
            f"{where}: no BING filters there; give a {SUFFIX} file, a folder with published ones, or their common "
            "beginning, as in DIR/ObjNessB2W8MAXBGR"
        )
    return (read_published(where),)


@cache
def own_filters() -> tuple[Filters, ...]:
    """Return the filters that come with the package; they know the embedded world only."""
    return load_filters(OWN)


def bing_boxes(
    image: NDArray[np.uint8], filters: Filters | Sequence[Filters] | None = None, count: int = COUNT
) -> NDArray[np.float32]:
    """Return the best boxes of an image as a source of the OBB library: float32 [n, 4] xyxy pixels, half-open.

    Args:
        image: uint8 RGB [H, W, 3].
        filters: what to use; None: ``own_filters()``.
        count: at most so many boxes.
    """
    return proposals(image, own_filters() if filters is None else filters, count)[0]
