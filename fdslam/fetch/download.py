"""Download of large files over HTTP: resumed where it broke off, tried again, checked by length.

A file that is not complete yet has the suffix ``.partial``; under its own name it is complete. Written on urllib, which
goes through the proxies that the environment names: neither pooch nor requests resumes a broken download by itself.
"""

from __future__ import annotations

import http.client
import os
import re
import shutil
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from fdslam.errors import InputError
from fdslam.fetch.meter import Meter, readable, say

CHUNK = 1 << 20  # bytes
TIMEOUT = 60.0  # seconds without a byte
PAUSES = (1.0, 5.0, 20.0, 60.0)  # seconds before each further try; an arriving byte starts the count anew
_TRANSIENT = (408, 429, 500, 502, 503, 504)
_AGENT = {"User-Agent": "fdslam", "Accept-Encoding": "identity"}


class Unreachable(InputError):
    """The server cannot be reached at all: the user is told what to do by hand."""


@dataclass(frozen=True)
class Remote:
    """A file on a server."""

    url: str
    size: int  # bytes


def partial_path(target: Path) -> Path:
    """Return where a file lies while it is not complete."""
    return target.with_name(target.name + ".partial")


@contextmanager
def disk_errors(path: Path) -> Iterator[None]:
    """Turn what the disk refuses into one line; what is already written stays."""
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written ({error.strerror or error}); what has arrived is kept: free some space or "
            "choose another folder with --to, and run the same command again"
        ) from error


def _open(url: str, method: str, start: int = 0) -> http.client.HTTPResponse:
    headers = _AGENT | ({"Range": f"bytes={start}-"} if start else {})
    try:
        request = urllib.request.Request(url, headers=headers, method=method)
        return urllib.request.build_opener().open(request, timeout=TIMEOUT)  # with the proxies of the environment
    except urllib.error.HTTPError as error:
        if error.code in _TRANSIENT:
            raise ConnectionError(f"the server says {error.code} {error.reason}") from error
        raise InputError(f"{url}: the server says {error.code} {error.reason}; check the name, or --base") from error
    except urllib.error.URLError as error:
        raise ConnectionError(str(error.reason)) from error
    except (ValueError, http.client.InvalidURL) as error:
        raise InputError(f"{url}: no address ({error}); check --base") from error


def probe(url: str) -> Remote:
    """Ask a server for the size of a file.

    Raises:
        InputError: the server does not have it, or does not say how long it is.
        Unreachable: no answer, after some tries.
    """
    for pause in (*PAUSES[:1], None):
        try:
            with _open(url, "HEAD") as response:
                length = response.headers.get("Content-Length", "")
            break
        except (ConnectionError, TimeoutError, http.client.HTTPException) as error:
            if pause is None:
                raise Unreachable(f"{url}: cannot be reached ({error or type(error).__name__})") from error
            time.sleep(pause)
    if not length.isdigit():
        raise InputError(f"{url}: the server does not say how long it is, so nothing could be checked; try --base")
    return Remote(url, int(length))


def check_room(folder: Path, needed: int) -> None:
    """Raise InputError if the disk where ``folder`` is, or will be, has fewer than ``needed`` bytes free."""
    there = next(place for place in (folder.absolute(), *folder.absolute().parents) if place.exists())
    with disk_errors(folder):
        free = shutil.disk_usage(there).free
    if free < needed:
        raise InputError(
            f"{folder}: {readable(free)} free, about {readable(needed)} are needed; free some space or choose another "
            "folder with --to"
        )


def arrived(remote: Remote, target: Path) -> int:
    """Return how many bytes of a file are here already."""
    if target.is_file() and target.stat().st_size == remote.size:
        return remote.size
    partial = partial_path(target)
    return min(partial.stat().st_size, remote.size) if partial.is_file() else 0


def download(remote: Remote, target: Path) -> None:
    """Download a file, from where an earlier try broke off; nothing is done if it is complete.

    Raises:
        InputError: the server does not have it, the disk refuses, or the connection broke too often without a byte.
    """
    if arrived(remote, target) == remote.size and target.is_file():
        return
    partial = partial_path(target)
    with disk_errors(partial):
        partial.parent.mkdir(parents=True, exist_ok=True)
        if target.is_file() and not partial.exists():
            say(f"{target}: not as long as the file on the server; taken for a download that broke off")
            os.replace(target, partial)
        partial.touch()
        if partial.stat().st_size > remote.size:
            say(f"{partial}: longer than the file on the server; begun anew")
            os.truncate(partial, 0)
    failures = 0
    with Meter(target.name, remote.size) as meter:
        while (have := partial.stat().st_size) < remote.size:
            error = _receive(remote, partial, have, meter)
            failures = 0 if partial.stat().st_size > have else failures + 1
            if partial.stat().st_size < remote.size:
                _wait(remote, partial, failures, error)
    with disk_errors(target):
        os.replace(partial, target)


def _wait(remote: Remote, partial: Path, failures: int, error: str) -> None:
    if failures > len(PAUSES):
        raise InputError(
            f"{remote.url}: broke off {failures} times without a byte ({error}); {partial} keeps what has arrived, "
            "run the same command again later"
        )
    pause = PAUSES[max(failures - 1, 0)]
    say(
        f"{partial.name}: {readable(partial.stat().st_size)} of {readable(remote.size)}, broke off ({error}); "
        f"going on in {pause:g} s"
    )
    time.sleep(pause)


def _receive(remote: Remote, partial: Path, have: int, meter: Meter) -> str:
    """Append what one connection gives; return why it ended early, where it did."""
    try:
        with _open(remote.url, "GET", have) as response, disk_errors(partial), partial.open("r+b") as file:
            if have and response.status != http.client.PARTIAL_CONTENT:
                say(f"{partial.name}: the server cannot go on where it broke off; begun anew")
                file.truncate(0)
                have = 0
            elif have:
                _check_range(remote, response, have)
            file.seek(have)
            left = remote.size - have
            while left and (data := _read(response, min(CHUNK, left))):
                file.write(data)
                left -= len(data)
                meter.show(remote.size - left)
            file.flush()
            os.fsync(file.fileno())
    except (ConnectionError, TimeoutError, http.client.HTTPException) as error:
        return str(error) or type(error).__name__
    return "the server hung up"


def _read(response: http.client.HTTPResponse, count: int) -> bytes:
    """Read from a connection; what breaks there is no fault of the disk."""
    try:
        return response.read(count)
    except OSError as error:
        raise http.client.HTTPException(str(error)) from error


def _check_range(remote: Remote, response: http.client.HTTPResponse, have: int) -> None:
    given = response.headers.get("Content-Range", "")
    match = re.fullmatch(r"bytes (\d+)-\d+/(\d+)", given)
    if match is None or (int(match[1]), int(match[2])) != (have, remote.size):
        raise InputError(
            f"{remote.url}: the server answers with {given!r}, not with the rest; remove the .partial file"
        )
