"""Models: downloaded by pooch, with resuming, and trusted only after their sha256 was checked or confirmed.

A file under its own name is confirmed, and ``NAME.sha256`` beside it says to every later fetch and run what it must be.
What has arrived and is not confirmed yet is called ``NAME.unconfirmed``.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pooch

from fdslam.errors import InputError
from fdslam.fetch.consent import confirm
from fdslam.fetch.download import Remote, Unreachable, check_room, disk_errors, download, probe
from fdslam.fetch.meter import readable, say
from fdslam.fetch.registry import MODELS, Published
from fdslam.onnx_model import load_model
from fdslam.store import sha256_file, write_atomically

_SHA256 = re.compile(r"[0-9a-f]{64}")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of a model to a command."""
    add, folder = parser.add_argument, Path(pooch.os_cache("fdslam"))
    add("--to", type=lambda t: Path(t).expanduser(), default=folder, metavar="DIR", help=f"if not said: {folder}")
    add("--yes", action="store_true", help="the terms are known, and whatever arrives is trusted: do not ask")
    add("--sha256", default="", type=str.lower, metavar="HEX", help="what the file must be, if you know it")
    add("--base", default="", metavar="URL", help="a mirror: a folder with a file of the same name")


def fetch(name: str, options: argparse.Namespace) -> None:
    """Download a model of the registry, or take what lies there already, and check it.

    Raises:
        InputError: the terms or the file not accepted, a file that is not what it must be, or whatever keeps it from
            arriving.
    """
    published = MODELS[name]
    if options.sha256 and not _SHA256.fullmatch(options.sha256):
        raise InputError(f"--sha256 {options.sha256}: give the 64 digits of a sha256")
    if options.base and not re.match(r"https?://", options.base):
        raise InputError(f"--base {options.base}: give an address that begins with http:// or https://")
    file = published.url.rpartition("/")[2]
    url = f"{options.base.rstrip('/')}/{file}" if options.base else published.url
    target: Path = options.to / file
    expected = _expected(published, target, options.sha256)
    if target.is_file():
        say(f"{target}: is there")
        _accept(target, target, expected, published, options.yes)
    else:
        waiting = target.with_name(file + ".unconfirmed")
        if not waiting.is_file():
            _bring(url, waiting, target, expected, published, options)
        _accept(waiting, target, expected, published, options.yes)
    say(published.use.format(path=shlex.quote(str(target))))


def _note(target: Path) -> Path:
    return target.with_name(target.name + ".sha256")


def _expected(published: Published, target: Path, told: str) -> str:
    """Return the sha256 that the file must have, "" where nobody knows."""
    recorded = ""
    if target.is_file() and _note(target).is_file():
        recorded = next(iter(_note(target).read_text(encoding="utf-8", errors="replace").split()), "")
    known = [one for one in (published.sha256, told, recorded) if one]
    if len(set(known)) > 1:
        raise InputError(
            f"{target}: its sha256 is {known[0]} by one account and {known[1]} by another (the registry, --sha256, "
            f"{_note(target).name}); find out which is right"
        )
    return known[0] if known else ""


def _bring(
    url: str, waiting: Path, target: Path, expected: str, published: Published, options: argparse.Namespace
) -> None:
    """Download to ``waiting``; pooch puts it there only if it is what is expected."""
    try:
        remote = probe(url)
    except Unreachable as error:
        raise InputError(
            f"{error}; behind a proxy set https_proxy; or get that file by other means, put it at {target} and run the "
            "same command again"
        ) from error
    say(f"{readable(remote.size):>9}  {url}\n           to {target}\n{published.summary}\nnamed at {published.page}")
    say(f"{_known(expected, published)}\nTerms: {published.licence}")
    check_room(target.parent, remote.size)
    confirm("Accept the terms and go on?", options.yes, "the terms were not accepted; answer yes, or give --yes")
    pooch.get_logger().setLevel("WARNING")  # it says what has been said above
    try:
        with disk_errors(waiting):
            pooch.retrieve(
                url,
                known_hash=f"sha256:{expected}" if expected else None,
                fname=waiting.name,
                path=waiting.parent,
                downloader=_Resuming(remote, target),
            )
    except ValueError as error:  # pooch's, of another hash; what came is gone
        raise InputError(
            f"{url}: what came does not have the sha256 {expected} and was thrown away; "
            "fetch it again, from another place if it stays so"
        ) from error


class _Resuming:
    """Downloads for pooch, and goes on where an earlier try broke off."""

    def __init__(self, remote: Remote, target: Path) -> None:
        self.remote, self.arriving = remote, target.with_name(target.name + ".arriving")

    def __call__(self, url: str, output_file: str, pooch: object, check_only: bool = False) -> None:
        download(self.remote, self.arriving)
        os.replace(self.arriving, output_file)


def _known(expected: str, published: Published) -> str:
    if expected:
        return f"its sha256 is known and is checked: {expected}"
    if published.begins:
        return (
            f"unverified: of its sha256 only the first digits are published, {published.begins}, which are checked; "
            "what arrives is shown, and you confirm it"
        )
    return "unverified: no sha256 is published; what arrives is shown, and you confirm it"


def _accept(file: Path, target: Path, expected: str, published: Published, yes: bool) -> None:
    """Check a file that is here, ask where its sha256 is not known, and let it stand under its own name."""
    digest = sha256_file(file)
    if expected and digest != expected:
        raise InputError(
            f"{file}: its sha256 is {digest} and must be {expected}; remove it and run the same command again"
        )
    with _thrown_away(file, target):
        if not digest.startswith(published.begins):
            raise InputError(f"{file}: its sha256 is {digest} and must begin with {published.begins}")
        if published.onnx:
            load_model(file, "file", "fetch it again")
    if not expected:
        say(f"sha256 of {file}: {digest}")
        refusal = (
            f"{file}: not confirmed, so it is not used; compare its sha256 with one you trust and run the same command "
            f"again, with --sha256 HEX or --yes"
        )
        confirm("Is that the file? It is taken for the right one from now on.", yes, refusal)
    write_atomically(_note(target), f"{digest}  {target.name}\n".encode())
    if file != target:
        os.replace(file, target)
    say(f"{target}: its sha256 is {'as expected' if expected else 'confirmed'}; {_note(target).name} keeps it")


@contextmanager
def _thrown_away(file: Path, target: Path) -> Iterator[None]:
    """Remove what has arrived and cannot be right, so that it is fetched anew; what a user put there stays."""
    try:
        yield
    except InputError as error:
        if file == target:
            raise
        file.unlink(missing_ok=True)
        raise InputError(f"{error}; it was thrown away, run the same command again") from error
