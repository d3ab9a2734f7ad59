"""NCLT: the images of one camera and the poses of the sessions asked for, from the publisher's bucket."""

from __future__ import annotations

import argparse
import json
import re
import shlex
from dataclasses import dataclass
from pathlib import Path

from fdslam.data.nclt.sessions import SEASONS, session_date
from fdslam.errors import InputError
from fdslam.fetch.archive import extract
from fdslam.fetch.consent import confirm
from fdslam.fetch.download import Remote, Unreachable, arrived, check_room, download, probe
from fdslam.fetch.meter import readable, say
from fdslam.store import write_atomically

SUMMARY = "NCLT: images of one camera, and poses, of the sessions named (about 100 GB to download for each)"
BASE = "https://s3.us-east-2.amazonaws.com/nclt.perl.engin.umich.edu"
CAMERAS = tuple(f"Cam{i}" for i in range(6))
LICENCE = """\
NCLT, the University of Michigan North Campus Long-Term Vision and LIDAR Dataset, is the publisher's, not fdslam's.
It is under the Open Database License (ODbL): name the source, and share what you derive from the database under the
same licence. Its terms, and the paper to cite: http://robots.engin.umich.edu/nclt"""
NO_CHECKSUM = (
    "No checksums are published: what is checked is the length the server gives, and the one inside each gzip."
)
_CAMERA_SHARE = 0.4  # of an archive's length, that the images of one of its six cameras may take unpacked


@dataclass(frozen=True)
class Item:
    """A file on the server and what becomes of it."""

    path: str  # under the base, and under the folder of the data set alike
    folder: str = ""  # regular expression of the folder, with its slash, of the members to unpack
    file: str = ""  # and of their names; "": it is no archive
    into: str = ""  # folder that they go to
    done: str = ""  # the note that says that it was unpacked to the end


def _folder(text: str) -> Path:
    return Path(text).expanduser()


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of NCLT to a command."""
    parser.add_argument(
        "--session", action="append", default=[], metavar="DATE", help=f"as 2012-01-22, or {', '.join(SEASONS)}; repeat"
    )
    parser.add_argument("--to", required=True, type=_folder, metavar="DIR", help="dataset.root of a run")
    parser.add_argument("--camera", default="Cam5", choices=CAMERAS, help="the one to unpack; Cam5 looks ahead")
    parser.add_argument("--undistortion", action="store_true", help="also the table for dataset.undistort=true")
    parser.add_argument("--keep", action="store_true", help="keep the archives, which hold all cameras, once unpacked")
    parser.add_argument("--yes", action="store_true", help="the licence is known: do not ask")
    parser.add_argument("--base", default=BASE, metavar="URL", help="a mirror of the bucket")


def items(sessions: list[str], camera: str, undistortion: bool) -> list[Item]:
    """Return what has to be fetched: poses first, since they are small."""
    found = [Item(f"ground_truth/groundtruth_{date}.csv") for date in sessions]
    if undistortion:
        table = rf"U2D_{camera}_1616X1232\.txt"
        done = f"U2D_{camera}_1616X1232.fetched"
        found.append(Item("ladybug3_calib/U2D_ALL_1616X1232.tar.gz", "(?:.*/)?", table, ".", done))
    for date in sessions:
        into = f"{date}/lb3/{camera}"
        found.append(Item(f"images/{date}_lb3.tar.gz", rf"(?:\./)?{into}/", r"\d+\.tiff?", into, f"{into}.fetched"))
    return found


def fetch(options: argparse.Namespace) -> None:
    """Download and unpack what the options name.

    Raises:
        InputError: nothing asked for, the licence not accepted, or whatever keeps a file from being complete.
    """
    sessions = list(dict.fromkeys(session_date(name, "--session") for name in options.session))
    if not sessions and not options.undistortion:
        raise InputError("nothing to fetch: give --session DATE, as often as you like, or --undistortion")
    if not re.match(r"https?://", options.base):
        raise InputError(f"--base {options.base}: give an address that begins with http:// or https://")
    todo = [item for item in items(sessions, options.camera, options.undistortion) if not _done(item, options.to)]
    if not todo:
        say(f"{options.to}: everything asked for is there")
        return
    remotes = {item.path: _probe(item, options) for item in todo}
    _show(todo, remotes, options)
    refusal = "the licence was not accepted; answer yes, or give --yes"
    confirm("Accept the licence and go on?", options.yes, refusal)
    for item in todo:
        _bring(item, remotes[item.path], options)
    say(f"done; run with dataset=nclt dataset.root={shlex.quote(str(options.to))} dataset.camera={options.camera}")


def _done(item: Item, to: Path) -> bool:
    """Whether a file was fetched to the end: a folder of images alone says nothing."""
    if not item.done:
        return (to / item.path).is_file()
    try:
        note = json.loads((to / item.done).read_text(encoding="utf-8"))
        return len(_unpacked(item, to)) >= note["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return False


def _unpacked(item: Item, to: Path) -> list[Path]:
    return [path for path in (to / item.into).iterdir() if re.fullmatch(item.file, path.name)]


def _probe(item: Item, options: argparse.Namespace) -> Remote | None:
    """Ask for the size of a file; None if the server is out of reach but the file was put here by hand."""
    target = options.to / item.path
    try:
        return probe(f"{options.base}/{item.path}")
    except Unreachable as error:
        if target.is_file():
            say(f"{target}: put here by hand, and its length cannot be asked for")
            return None
        raise InputError(
            f"{error}; behind a proxy set https_proxy; or get that file by other means, put it at {target} and run the "
            "same command again"
        ) from error


def _show(todo: list[Item], remotes: dict[str, Remote | None], options: argparse.Namespace) -> None:
    """Say what will be done, and find at the start that the disk is too small for it."""
    rest = held = peak = 0
    for item in todo:
        remote = remotes[item.path]
        if remote is None:
            continue
        here = arrived(remote, options.to / item.path)
        say(f"{readable(remote.size):>9}  {remote.url}" + (f" ({readable(here)} of it are here)" if here else ""))
        rest += remote.size - here
        unpacked = round(_CAMERA_SHARE * remote.size) if item.file else 0
        peak = max(peak, held + remote.size - here + unpacked)
        held += unpacked + (-here if item.file and not options.keep else remote.size - here)
    archives = "are kept" if options.keep else "are removed once unpacked (--keep keeps them)"
    say(f"to {options.to}: {readable(rest)} to download; {options.camera} is unpacked, the archives {archives}")
    say(f"{NO_CHECKSUM}\n{LICENCE}")
    check_room(options.to, peak)


def _bring(item: Item, remote: Remote | None, options: argparse.Namespace) -> None:
    target = options.to / item.path
    if remote is not None:
        download(remote, target)
    if not item.file:
        return
    pattern = re.compile(f"{item.folder}({item.file})")

    def wanted(name: str) -> Path | None:
        match = pattern.fullmatch(name)
        return options.to / item.into / match[1] if match else None

    count = extract(target, wanted)
    if not count:
        raise InputError(
            f"{target}: holds nothing of {options.camera}; remove it and download it again, or check --base"
        )
    note = {"archive": item.path, "bytes": target.stat().st_size, "files": count}
    write_atomically(options.to / item.done, json.dumps(note).encode())
    say(f"{options.to / item.into}: {count} files, the archive is whole")
    if not options.keep:
        target.unlink()
