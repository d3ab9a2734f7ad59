"""The filters published with the paper: three files a colour space, OpenCV's YAML in gzip.

``NAME.wS1.yml.gz`` holds the filter of stage I (8 × 8), ``NAME.wS2.yml.gz`` the lines of stage II (n × 2) and
``NAME.idx.yml.gz`` which of the 36 window sizes they are for (n × 1). NAME ends in MAXBGR, HSV or I.
"""

from __future__ import annotations

import gzip
import re
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fdslam.errors import InputError
from fdslam.obb.bing.filters import Filters

ENDINGS = {"MAXBGR": "maxbgr", "HSV": "hsv", "I": "grey"}  # of the name -> colour space
PARTS = ("wS1", "wS2", "idx")
_LARGEST = 1_000_000  # bytes, unpacked; the real ones have some 2,000
_MATRIX = re.compile(
    r"\A%YAML[^\n]*\n(?:---[^\n]*\n)?\s*\w+:\s*!!opencv-matrix\s+"
    r"rows:\s*(\d+)\s+cols:\s*(\d+)\s+dt:\s*\"?([ifd])\"?\s+data:\s*\[([^\]]*)\]\s*(?:\.\.\.)?\s*\Z"
)


def published_files(prefix: Path) -> tuple[Path, ...]:
    """Return the three files of a colour space, whether or not they are there."""
    return tuple(prefix.parent / f"{prefix.name}.{part}.yml.gz" for part in PARTS)


def published_prefixes(folder: Path) -> list[Path]:
    """Return the prefixes of all triplets in a folder, in the order of ENDINGS."""
    names = {file.name.partition(".")[0] for part in PARTS for file in folder.glob(f"*.{part}.yml.gz")}
    return [folder / name for ending in ENDINGS for name in sorted(names) if _ending(name) == ending]


def read_published(prefix: Path) -> Filters:
    """Read the three files of one colour space, e.g. of ``…/ObjNessB2W8MAXBGR``.

    Raises:
        InputError: a file is missing, torn or not what it should be, or the name tells no colour space.
    """
    ending = _ending(prefix.name)
    if ending is None:
        raise InputError(f"{prefix}: the name of published BING filters ends in {', '.join(ENDINGS)}")
    first, second, sizes = (_matrix(path) for path in published_files(prefix))
    try:
        return Filters(
            ENDINGS[ending],
            first.astype(np.float32),
            sizes.ravel().astype(np.int32),
            second.astype(np.float32),
        )
    except InputError as error:
        raise InputError(f"{prefix}.*.yml.gz: do not fit together ({error}); copy all three again") from None


def _ending(name: str) -> str | None:
    return next((ending for ending in ENDINGS if name.endswith(ending)), None)


def _matrix(path: Path) -> NDArray[np.float64]:
    """Return the one matrix in a file: float64 [rows, cols]."""
    try:
        with gzip.open(path) as file:
            text = file.read(_LARGEST + 1)
    except FileNotFoundError:
        raise InputError(
            f"{path}: no such file; published BING filters are {', '.join(PARTS)} .yml.gz of one name"
        ) from None
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: not a whole gzip file ({error}); copy it again") from None
    found = _MATRIX.match(text.decode("utf-8", "replace")) if len(text) <= _LARGEST else None
    try:
        if found is None:
            raise ValueError("no matrix")
        values = np.array([float(value) for value in found[4].split(",")])
        return values.reshape(int(found[1]), int(found[2]))
    except ValueError:
        raise InputError(f"{path}: does not hold one OpenCV matrix in YAML; copy it again") from None
