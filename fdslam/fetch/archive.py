"""Files out of a .tar.gz as it streams by: only those asked for, under names of our own, and the archive's checksum."""

from __future__ import annotations

import gzip
import os
import tarfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import IO

from fdslam.errors import InputError
from fdslam.fetch.download import CHUNK, disk_errors
from fdslam.fetch.meter import Meter

MOST_BYTES = 200_000_000  # of one file: far more than any image or table of the archives


def extract(archive: Path, wanted: Callable[[str], Path | None]) -> int:
    """Write the files of an archive that are ``wanted``; return how many there are.

    The archive is read once from end to end, whatever it holds, in little memory. A file that is there with its right
    size is left as it is, so that an extraction that broke off goes on. No member decides where it is written: its name
    is only looked at.

    Args:
        archive: a .tar.gz.
        wanted: from the name of a member to where it belongs, None: nowhere.

    Raises:
        InputError: a broken archive, a member that would leave the folder, a link or device under a wanted name, a file
            too large, or a disk that refuses.
    """
    count = 0
    with (
        _broken_is_said(archive),
        archive.open("rb") as raw,
        Meter(f"unpacking {archive.name}", archive.stat().st_size) as meter,
        gzip.GzipFile(fileobj=raw) as stream,
    ):
        with tarfile.open(fileobj=stream, mode="r|") as tar:
            for member in tar:
                meter.show(raw.tell())
                target = wanted(_safe(archive, member))
                if target is None:
                    continue
                if not member.isfile() or member.size > MOST_BYTES:
                    raise InputError(f"{archive}: {member.name!r} is no plain file of a sane size; download it again")
                content = tar.extractfile(member)
                assert content is not None  # by isfile
                _write(content, member.size, target)
                count += 1
        _drain(archive, stream)
    return count


def _safe(archive: Path, member: tarfile.TarInfo) -> str:
    name = PurePosixPath(member.name)
    if name.is_absolute() or ".." in name.parts or "\\" in member.name or "\0" in member.name:
        raise InputError(f"{archive}: holds {member.name!r}, which points out of it; remove it and download it again")
    return name.as_posix()


@contextmanager
def _broken_is_said(archive: Path) -> Iterator[None]:
    try:
        yield
    except (EOFError, zlib.error, gzip.BadGzipFile, tarfile.TarError) as error:
        raise InputError(f"{archive}: broken archive ({error}); remove it and download it again") from error
    except OSError as error:
        raise InputError(f"{archive}: cannot be read ({error.strerror or error})") from error


def _write(content: IO[bytes], size: int, target: Path) -> None:
    if target.is_file() and target.stat().st_size == size:
        return
    data = content.read()
    temporary = target.with_name(target.name + ".partial")
    with disk_errors(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, target)


def _drain(archive: Path, stream: gzip.GzipFile) -> None:
    """Read to the end, where gzip compares its checksum; behind the last member there may only be zeros."""
    while data := stream.read(CHUNK):
        if any(data):
            raise InputError(f"{archive}: broken archive (a header in its middle); remove it and download it again")
