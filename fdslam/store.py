"""Artefacts: content-addressed, written atomically, checksummed. The only writer of files.

An artefact's key is the hash of everything that decides its content: the stage, the stage's source code (with all the
fdslam modules it imports) and the versions of its libraries, the configuration it reads and the keys or digests of its
inputs. A file under its final name is complete: it is written beside it, flushed to disk and renamed. Existence alone
is still not trusted: the content's checksum is verified when an artefact is read, and a damaged one is removed and made
again.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.metadata
import json
import logging
import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from fdslam.errors import InputError
from fdslam.syntax import parse

log = logging.getLogger(__name__)
Arrays = dict[str, np.ndarray]
Key = str  # hex sha256

PACKAGE = Path(__file__).parent
# Ground floor: what they hold is schema or plumbing, and reaches a key through the values themselves.
NOT_PART_OF_A_RESULT = {"fdslam", "fdslam.errors", "fdslam.config", "fdslam.store", "fdslam.progress"}


def write_atomically(path: Path, *data: bytes | memoryview) -> None:
    """Write the pieces of ``data`` to ``path``: a kill at any time leaves the old file or the new, never a torn one.

    Raises:
        InputError: the folder cannot be written or the disk is full.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = path.parent / f".{uuid4().hex}.partial"
        try:
            with temporary.open("xb") as file:
                for piece in data:
                    file.write(piece)
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)  # there only if something failed
    except OSError as error:
        raise InputError(
            f"cannot write {path}: {error.strerror or error}; what is finished is kept: "
            "free some space or choose another folder (store=…, hydra.run.dir=…) and run again"
        ) from error


def sha256_file(path: Path) -> str:
    """Return the sha256 of a file's bytes as hex."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def digest(value: Any) -> Key:
    """Return the sha256 of a JSON-able value in canonical form."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


@cache
def code_version(module: str) -> str:
    """Return a hash of a module's source and of every fdslam module that it imports, directly or through others."""
    waiting, sources = [module], {}
    while waiting:
        name = waiting.pop()
        if name in sources or name in NOT_PART_OF_A_RESULT:
            continue
        base = PACKAGE.joinpath(*name.split(".")[1:])
        path = base / "__init__.py" if base.is_dir() else base.with_suffix(".py")
        if not path.is_file():  # `from fdslam.x import name` names an attribute of x, and x itself is already listed
            continue
        sources[name] = path.read_text(encoding="utf-8")
        for node in ast.walk(parse(sources[name])):
            if isinstance(node, ast.Import):
                waiting += [alias.name for alias in node.names if alias.name.startswith("fdslam")]
            elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("fdslam"):
                waiting += [f"{node.module}", *(f"{node.module}.{alias.name}" for alias in node.names)]
    return digest(sorted(sources.items()))


@cache
def _version(distribution: str) -> str:
    return importlib.metadata.version(distribution)


@dataclass(frozen=True)
class Stage:
    """A named step whose results are stored: its code and the libraries that decide its numbers."""

    name: str  # also the folder of its artefacts
    modules: tuple[str, ...]  # whose source, with all that they import, decides the result
    libraries: tuple[str, ...] = ()  # distributions whose version matters, e.g. "opencv-python-headless"

    def key(self, config: Mapping[str, Any], inputs: Iterable[str]) -> Key:
        """Return the address of the artefact made from ``inputs`` (keys and digests) under ``config``."""
        versions = [[name, _version(name)] for name in self.libraries]
        code = [code_version(module) for module in self.modules]
        return digest([self.name, code, versions, dict(config), list(inputs)])


def _checksum(arrays: Arrays) -> str:
    total = hashlib.sha256()
    for name in sorted(arrays):
        array = np.asarray(arrays[name], order="C")
        total.update(f"{name}|{array.dtype.str}|{array.shape}|".encode())
        total.update(array.tobytes())
    return total.hexdigest()


class Store:
    """A folder of artefacts, one safetensors file each, shared by any number of runs and processes."""

    def __init__(self, root: str | Path) -> None:
        self.root = Path(root)

    def path(self, stage: Stage, key: Key) -> Path:
        """Return where the artefact lies, whether or not it is there."""
        return self.root / stage.name / key[:2] / f"{key}.safetensors"

    def lacks(self, stage: Stage, keys: Iterable[Key]) -> int:
        """Count the artefacts that are not there, by their files alone: for estimates, not for results."""
        return sum(not self.path(stage, key).is_file() for key in keys)

    def has(self, stage: Stage, key: Key) -> bool:
        """Tell whether an undamaged artefact is there."""
        return self.get(stage, key) is not None

    def get(self, stage: Stage, key: Key) -> Arrays | None:
        """Return the arrays of an artefact, or None if it is absent or was damaged (then it is removed)."""
        path = self.path(stage, key)
        try:
            with safe_open(path, framework="numpy") as file:
                arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a mapping
                expected = (file.metadata() or {}).get("sha256")
        except FileNotFoundError:
            return None
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error}); choose another store with store=DIR") from error
        except SafetensorError:
            arrays, expected = {}, None
        if expected != _checksum(arrays):
            log.warning("%s is damaged: it is made again", path)
            with suppress(OSError):  # a folder that is only read
                path.unlink(missing_ok=True)
            return None
        return arrays

    def put(self, stage: Stage, key: Key, arrays: Arrays) -> None:
        """Store the arrays under the key; raises InputError if the disk refuses."""
        arrays = {name: np.asarray(array, order="C") for name, array in arrays.items()}
        write_atomically(self.path(stage, key), save(arrays, metadata={"sha256": _checksum(arrays)}))

    def discard(self, stage: Stage, key: Key) -> None:
        """Remove an artefact that nobody needs any more, if it is there."""
        self.path(stage, key).unlink(missing_ok=True)
