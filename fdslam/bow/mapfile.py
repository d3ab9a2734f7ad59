"""A map on disk: one file, versioned, checksummed, and mapped into memory instead of read.

The layout is that of safetensors (eight bytes of header length, a JSON header, the arrays), so that any safetensors
reader opens it. Arrays of wide items come first, which keeps every array aligned.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fdslam.errors import InputError
from fdslam.store import write_atomically

NAMES = {"U64": np.uint64, "I64": np.int64, "I32": np.int32, "F32": np.float32, "U16": np.uint16, "U8": np.uint8}
NAMES |= {"U32": np.uint32, "F64": np.float64}
_CODES = {np.dtype(kind): name for name, kind in NAMES.items()}
_ALIGNED = 64  # bytes


def save(path: Path, arrays: Mapping[str, NDArray], version: int, settings: Mapping[str, Any]) -> None:
    """Write the arrays to one file, atomically.

    Args:
        path: the file; one of that name is replaced.
        arrays: by name, of the dtypes in NAMES.
        version: of the layout of ``arrays``; ``load`` refuses another.
        settings: what else the reader must know, as JSON.

    Raises:
        InputError: the disk refuses.
    """
    ordered = sorted(arrays.items(), key=lambda item: (-item[1].dtype.itemsize, item[0]))
    pieces = [np.ascontiguousarray(array) for _, array in ordered]
    checksum = hashlib.sha256()
    header: dict[str, Any] = {}
    at = 0
    for (name, _), piece in zip(ordered, pieces, strict=True):
        checksum.update(piece.data)
        span = [at, at + piece.nbytes]
        header[name] = {"dtype": _CODES[piece.dtype], "shape": list(piece.shape), "data_offsets": span}
        at = span[1]
    about = {"version": str(version), "settings": json.dumps(dict(settings))}
    checksum.update(_canonical(header, about))
    about["sha256"] = checksum.hexdigest()
    text = json.dumps({"__metadata__": about, **header}).encode()
    text += b" " * (-(len(text) + 8) % _ALIGNED)
    write_atomically(path, len(text).to_bytes(8, "little"), text, *(piece.data for piece in pieces))


def _canonical(header: Mapping[str, Any], about: Mapping[str, str]) -> bytes:
    """Return what the header says, as bytes that do not depend on how it was written."""
    return json.dumps([dict(header), about["version"], about["settings"]], sort_keys=True).encode()


def load(path: Path, version: int) -> tuple[dict[str, NDArray], dict[str, Any]]:
    """Map a file that ``save`` wrote; it is read once, for its checksum.

    Args:
        path: the file.
        version: the one that is understood.

    Returns:
        the arrays, mapped, and the settings. What is written to an array stays in memory.

    Raises:
        InputError: no such file, not a map, another version, or damaged.
    """
    again = "build the map again"
    try:
        with path.open("rb") as file:
            length = int.from_bytes(file.read(8), "little")
            header = json.loads(file.read(length)) if length < 1 << 24 else {}
            about = header.pop("__metadata__")
            found, wanted = int(about["version"]), about["sha256"]
        start = 8 + length
        data = np.memmap(path, np.uint8, "c", offset=start) if path.stat().st_size > start else np.zeros(0, np.uint8)
        if found != version:
            raise InputError(f"{path}: a map of version {found}, this program reads version {version}; {again}")
        arrays = {}
        for name, entry in header.items():
            begin, end = entry["data_offsets"]
            arrays[name] = data[begin:end].view(NAMES[entry["dtype"]]).reshape(entry["shape"])
        settings = json.loads(about["settings"])
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); {again}") from error
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise InputError(f"{path}: not a map, or cut short; {again}") from error
    checksum = hashlib.sha256(data.data)
    checksum.update(_canonical(header, about))
    if checksum.hexdigest() != wanted:
        raise InputError(f"{path}: damaged, its checksum is wrong; {again}")
    return arrays, settings
