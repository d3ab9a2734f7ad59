"""The digests of large files, remembered from run to run.

Hashing thousands of images of 6 MB takes minutes from a disk, so a file whose path, size and times of last change are
what they were is taken to hold what it held, as git and make do. The time of the last change of its inode is among
them: nothing that keeps the other one (``touch -d``, ``cp -p``) can set that. A file that changed a moment ago is
hashed again the next time, since it may change once more within the same tick of the clock.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np

from fdslam.store import Key, Stage, Store, sha256_file

HASHED = Stage("file_digest", ())
SETTLED = 2_000_000_000  # ns: coarser clocks of file systems tick every 2 s


def known_digest(path: Path, store: Store) -> str | None:
    """Return the sha256 of a file's bytes as hex if it is remembered and the file is as it was; it is not read.

    Raises:
        OSError: there is no such file.
    """
    known = store.get(HASHED, _key(path, path.stat()))
    return None if known is None else known["sha256"].tobytes().hex()


def remembered_digest(path: Path, store: Store) -> str:
    """Return the sha256 of a file's bytes as hex, from the store if the file is as it was.

    Raises:
        OSError: the file cannot be read.
    """
    known = known_digest(path, store)
    if known is not None:
        return known
    state = path.stat()
    value = sha256_file(path)
    if time.time_ns() - max(state.st_mtime_ns, state.st_ctime_ns) > SETTLED:
        store.put(HASHED, _key(path, state), {"sha256": np.frombuffer(bytes.fromhex(value), np.uint8)})
    return value


def _key(path: Path, state: os.stat_result) -> Key:
    values = (state.st_size, state.st_mtime_ns, state.st_ctime_ns)
    return HASHED.key({}, [str(path.absolute()), *map(str, values)])
