"""The command for one's own photos: ``python -m fdslam.detect --map DIR QUERY…``.

Builds the map from a folder of photos, or loads one that was saved, says where every query was taken, and leaves boxes
of what may have changed, a picture each, and a page to look at.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fdslam.errors import InputError
from fdslam.progress import progress, say, silence
from fdslam.provenance import Stopwatch, provenance
from fdslam.store import Store, write_atomically

if TYPE_CHECKING:
    from fdslam.api import ChangeDetector
    from fdslam.types import Frame

USAGE_ERROR, INTERRUPTED = 2, 130
EPILOG = """examples:
  python -m fdslam.detect --map photos/before photos/after
  python -m fdslam.detect --map photos/before --save before.map          build the map once,
  python -m fdslam.detect --map before.map photos/after walk.mp4         and use it without its photos
  python -m fdslam.detect --map before.map --add photos/after --save after.map      let it grow
  python -m fdslam.detect --map photos/before a.jpg --json               for scripts
exit status: 0 done, 2 something that the line on standard error says how to mend, 130 interrupted"""


def options() -> argparse.ArgumentParser:
    """Return what the command asks for."""
    parser = argparse.ArgumentParser(
        "python -m fdslam.detect",
        description="Say where photos were taken and what has changed there.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("query", nargs="*", metavar="QUERY", help="images, folders of images, and videos")
    add(
        "--map",
        required=True,
        type=Path,
        metavar="DIR",
        help="a folder of images in the order of the path, or a saved map",
    )
    add(
        "--add",
        action="append",
        default=[],
        type=Path,
        metavar="DIR",
        help="a folder of images taken since, which the map grows by; it keeps what it has learned",
    )
    add("--save", type=Path, metavar="DIR", help="save the map, which then does without its images")
    add("--mode", default="best", help="paper, tuned, raw or best (the default), see docs/modes.md")
    add("--detectors", default="", metavar="ROW", help="e.g. FD, CC+EF or FD+AD+PC; without it the mode's own")
    add("--share", type=float, default=5.0, metavar="X", help="percent of all cells that count as changed (5)")
    add("--top", type=int, default=10, metavar="N", help="most boxes of an image (10)")
    add("--every", type=float, default=1.0, metavar="SECONDS", help="of a video: between two frames (1)")
    add("--out", type=Path, metavar="DIR", help="where results go (outputs/detect/DATE)")
    add(
        "--store",
        type=Path,
        default=Path("outputs/store"),
        metavar="DIR",
        help="what a second run reuses (outputs/store)",
    )
    add("--set", action="append", default=[], metavar="KEY=VALUE", help="any other key of fdslam.run, e.g. obb=j_b")
    add("--json", action="store_true", help="print the boxes as JSON, and nothing else, on standard output")
    add("--quiet", action="store_true", help="show no progress")
    return parser


def check(asked: argparse.Namespace) -> None:
    """Find in the first second what is wrong with the words."""
    if not 0 < asked.share <= 100:
        raise InputError(f"--share {asked.share}: percent of the cells, above 0 and at most 100")
    if asked.top < 0 or not asked.every >= 0:  # nor NaN
        raise InputError("--top and --every: 0 or more")
    if not asked.query and asked.save is None:
        raise InputError("no QUERY given: name images, folders or videos, or --save DIR to build the map alone")
    if not asked.map.exists():
        raise InputError(f"--map {asked.map}: no such folder; give one with images, or a saved map")
    for added in asked.add:
        if not added.is_dir():
            raise InputError(f"--add {added}: no such folder; give one with images")
    for query in map(Path, asked.query):
        if not query.exists():
            raise InputError(f"{query}: no such image, folder or video")
    for option in ("out", "store", "save"):
        folder = getattr(asked, option)
        if folder is not None and not _can_be_written(folder.parent if option == "save" else folder):
            raise InputError(f"--{option} {folder}: cannot be written; choose another folder")
    if asked.out is not None and asked.out.is_dir() and any(asked.out.iterdir()):
        raise InputError(f"--out {asked.out}: is there and not empty; choose a new folder, nothing is overwritten")


def _can_be_written(folder: Path) -> bool:
    """Tell whether files can be made in a folder or, where there is none, the folder itself."""
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    return there.is_dir() and os.access(there, os.W_OK | os.X_OK)


def frames_in(queries: Sequence[str], every: float, folder: Path) -> Iterator[Frame]:
    """Yield the frames of images, folders and videos in the order that they are named in.

    Args:
        queries: their paths.
        every: seconds between two frames of a video.
        folder: that frames of videos are written to.
    """
    from fdslam.data import video
    from fdslam.data.live import file_frame, images_in

    for number, path in enumerate(map(Path, queries)):
        if path.is_dir():
            yield from (file_frame(image) for image in images_in(path))
        elif path.suffix.lower() in video.SUFFIXES:
            inner = folder / str(number)
            inner.mkdir()
            yield from video.video_frames(path, every, inner)
        else:
            yield file_frame(path)


def detector_of(asked: argparse.Namespace) -> ChangeDetector:
    """Return the detector with its map, built or loaded."""
    from fdslam.api import ChangeDetector
    from fdslam.saved import is_saved

    if is_saved(asked.map):
        if asked.detectors or asked.mode != "best":
            say(
                "--mode and --detectors: those that the map was saved with are used; name a folder of images for others"
            )
        return ChangeDetector.load(asked.map, asked.set, verbose=not asked.quiet)
    made = ChangeDetector(asked.mode, asked.detectors, asked.set, asked.store, verbose=not asked.quiet)
    return made.fit(asked.map)


def detect(asked: argparse.Namespace) -> str:
    """Do what was asked for; return what is to be printed."""
    from fdslam.data.images import image_size
    from fdslam.data.live import images_in
    from fdslam.report.findings import findings

    watch = Stopwatch()
    out = asked.out or Path("outputs") / "detect" / time.strftime("%Y-%m-%d_%H-%M-%S")
    with tempfile.TemporaryDirectory(prefix="fdslam-") as folder, warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="PIL")  # of a torn file, just before the error that names it
        frames = list(frames_in(asked.query, asked.every, Path(folder)))  # what is no image is told before the map
        for image in chain.from_iterable(map(images_in, asked.add)):
            image_size(image)
        with watch.stage("map"):
            detector = detector_of(asked)
            for added in asked.add:
                detector.update(added, learn=False)
        if asked.save is not None:
            detector.save(asked.save)
            say(f"map of {len(detector)} images saved to {asked.save}")
        if frames:
            return _found(asked, detector, frames, out, watch)
        return json.dumps(findings([], _about(asked, detector))) if asked.json else ""


def _about(asked: argparse.Namespace, detector: ChangeDetector) -> dict[str, Any]:
    return {
        "mode": detector.config.mode,
        "detectors": detector.row,
        "share": asked.share,
        "map": str(asked.map),
        "map_images": len(detector),
    }


def _found(
    asked: argparse.Namespace, detector: ChangeDetector, frames: list[Frame], out: Path, watch: Stopwatch
) -> str:
    from fdslam.data.images import read_image
    from fdslam.detection import detections
    from fdslam.report.findings import findings
    from fdslam.report.overlay import overlay
    from fdslam.report.page import write_page
    from fdslam.saved import as_utf8

    outcome = detector.outcome(frames, Store(asked.store), watch)
    outcome = replace(outcome, dataset=replace(outcome.dataset, name=asked.map.name))
    found = [(one, one.candidates(asked.share, asked.top)) for one in detections(outcome, detector.row)]
    told = findings(found, _about(asked, detector))
    with watch.stage("pictures"):
        names = picture_names([frame.name for frame in frames])
        drawn = list(zip(frames, found, names, strict=True))
        for frame, (one, boxes), name in progress(drawn, len(drawn), "pictures"):
            write_atomically(out / "overlays" / name, overlay(read_image(frame.path), one.places, boxes))
    write_atomically(out / "boxes.json", as_utf8(told))
    run = provenance(asdict(detector.config), watch, detector.config.workers)
    run["command"] = ["python", "-m", "fdslam.detect", *run["command"][1:]]  # as it was typed
    title = f"{', '.join(asked.query)} against {asked.map}"
    write_page(outcome, detector.config, out / "report.html", run, title, [boxes for _, boxes in found])
    if asked.json:
        return json.dumps(told)  # in ASCII, which any terminal and any script takes
    return f"{summary(told)}\n\nwritten to {out}: report.html to look at, boxes.json (COCO), overlays/"


def picture_names(names: Sequence[str]) -> list[str]:
    """Return a file name for each image's picture: its own, with a number where several are called so."""
    found: dict[str, None] = {}  # in their order
    for name in names:
        stem = Path(name).stem if "@" not in name else Path(name).name.replace("@", "_")
        free = (f"{stem}-{number}.jpg" for number in count(2))
        found[next(one for one in chain([f"{stem}.jpg"], free) if one not in found)] = None
    return list(found)


def summary(told: dict[str, Any]) -> str:
    """Return a line per image: where it was taken, how many boxes it has, and the highest score."""
    from fdslam.report.tables import aligned

    lines = [["image", "place", "boxes", "highest score"]]
    for image in told["images"]:
        scores = [one["score"] for one in told["annotations"] if one["image_id"] == image["id"]]
        place = "lost" if image["lost"] or not image["hypotheses"] else image["hypotheses"][0]["image"]
        lines.append(
            [
                _on_one_line(image["file_name"]),
                _on_one_line(place),
                str(len(scores)),
                f"{max(scores):.1f}" if scores else "–",
            ]
        )
    return "\n".join(aligned(lines, (0,)))


def _on_one_line(name: str) -> str:
    """Return a name with what would break a line, steer a terminal or is no Unicode escaped."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in name)


def _print(text: str) -> None:
    """Print, escaping what the terminal cannot show; a reader that has gone has read what it wanted."""
    if sys.stdout is None:  # closed from the start
        return
    encoding = sys.stdout.encoding or "utf-8"
    try:
        print(text.encode(encoding, "backslashreplace").decode(encoding), flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or Python complains when it ends


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit status."""
    asked = options().parse_args(arguments)
    try:
        check(asked)
        with silence(asked.quiet):
            printed = detect(asked)
        if printed:
            _print(printed)
    except InputError as error:
        line = str(error).replace("store=…, hydra.run.dir=…", "--store, --out")  # what they are called here
        print(f"fdslam: {line}", file=sys.stderr)
        return USAGE_ERROR
    except OSError as error:
        name = f"{error.filename}: " if error.filename else ""
        print(f"fdslam: {name}{error.strerror or error}; choose other folders with --store and --out", file=sys.stderr)
        return USAGE_ERROR
    except KeyboardInterrupt:
        print("fdslam: interrupted; what is finished is kept, run again to go on", file=sys.stderr)
        return INTERRUPTED
    return 0


if __name__ == "__main__":
    sys.exit(main())
