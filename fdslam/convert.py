"""The command ``python -m fdslam.convert FROM TO.json``: CVAT, LabelMe or COCO annotations to one COCO file."""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from fdslam.data.annotations import AnnotatedImage, coco_json, locate, read_annotations
from fdslam.errors import InputError
from fdslam.store import write_atomically

USAGE_ERROR = 2


def convert(source: Path, target: Path, force: bool = False) -> tuple[AnnotatedImage, ...]:
    """Write the annotations at ``source`` as a COCO file, and return what was written.

    Images need not be there. Where they are, their names become relative to the folder of ``target``; boxes are written
    as they were drawn, also where they reach over the border.

    Raises:
        InputError: the source cannot be read, the target has another suffix or is there already.
    """
    if target.suffix.lower() != ".json":
        raise InputError(f"{target}: a COCO file ends in .json; name it so")
    if target.exists() and not force:
        raise InputError(f"{target}: is there already; choose another name or add --force")
    if not source.exists():
        raise InputError(f"{source}: not there; give a COCO or CVAT file, or a LabelMe folder")
    images = tuple(_renamed(image, target.absolute().parent) for image in read_annotations(source))
    write_atomically(target, coco_json(images))
    return images


def _renamed(image: AnnotatedImage, folder: Path) -> AnnotatedImage:
    path = locate(image, (folder, folder / "query"))
    if path is None:
        return image
    return replace(image, file=Path(os.path.relpath(path.absolute(), folder)).as_posix())


def _summary(images: Sequence[AnnotatedImage]) -> str:
    labels = Counter(one.label for image in images for one in image.annotations)
    boxes = ", ".join(f"{label} {count}" for label, count in sorted(labels.items()))
    return f"{_count(len(images), 'image')}, {_count(labels.total(), 'box')}{f' ({boxes})' if boxes else ''}"


def _count(number: int, thing: str) -> str:
    plural = "es" if thing.endswith("x") else "s"
    return f"{number} {thing}{plural if number != 1 else ''}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; exits with 0, or with 2 for something the user can mend."""
    parser = argparse.ArgumentParser(prog="python -m fdslam.convert", description=__doc__.partition(": ")[2])
    parser.add_argument("source", metavar="FROM", type=Path, help="annotations.xml, a LabelMe folder or a COCO file")
    parser.add_argument("target", metavar="TO.json", type=Path, help="the COCO file to write")
    parser.add_argument("--force", action="store_true", help="write over TO.json if it is there")
    given = parser.parse_args(arguments)
    try:
        images = convert(given.source, given.target, given.force)
    except InputError as error:
        print(f"fdslam: {error}", file=sys.stderr)
        sys.exit(USAGE_ERROR)
    print(f"{given.target}: {_summary(images)}")


if __name__ == "__main__":
    main()
