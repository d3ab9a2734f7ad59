"""Annotations of what has changed: COCO, CVAT and LabelMe, read into one form; a plain dict from format to reader."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from fdslam.data.annotations.annotation import AnnotatedImage, Annotation
from fdslam.data.annotations.coco import coco_json, read_coco
from fdslam.data.annotations.cvat import read_cvat
from fdslam.data.annotations.labelme import read_labelme
from fdslam.data.annotations.matching import check_size, clipped, locate, match_boxes
from fdslam.errors import InputError

__all__ = [
    "READERS",
    "AnnotatedImage",
    "Annotation",
    "check_size",
    "clipped",
    "coco_json",
    "find_annotations",
    "locate",
    "match_boxes",
    "read_annotations",
]

READERS: dict[str, Callable[[Path], tuple[AnnotatedImage, ...]]] = {
    "coco": read_coco,
    "cvat": read_cvat,
    "labelme": read_labelme,
}
_BY_SUFFIX = {".json": "coco", ".xml": "cvat"}


def find_annotations(base: Path, given: str = "") -> Path | None:
    """Return the annotations of a data set, or None if it has none.

    Args:
        base: the folder of the data set. Looked for are annotations.json (COCO), annotations.xml (CVAT), annotations/
            (LabelMe) and JSON files beside the images in query/, where LabelMe puts them.
        given: the path to them, instead of looking.

    Raises:
        InputError: the path given is not there, or there are two.
    """
    if given:
        path = Path(given).expanduser()
        if not path.exists():
            raise InputError(f"dataset.annotations={given}: not there; give a COCO or CVAT file, or a LabelMe folder")
        return path
    names = [name for name in ("annotations.json", "annotations.xml", "annotations") if (base / name).exists()]
    if (base / "query").is_dir() and any((base / "query").rglob("*.json")):
        names.append("query")
    if len(names) > 1:
        raise InputError(
            f"{base}: annotations in {' and in '.join(names)}; keep one, or choose with "
            f"dataset.annotations={base / names[0]}"
        )
    return base / names[0] if names else None


def read_annotations(path: Path) -> tuple[AnnotatedImage, ...]:
    """Return the annotated images of a COCO file (.json), a CVAT file (.xml) or a folder of LabelMe files.

    Raises:
        InputError: none of the three, or one that cannot be read.
    """
    kind = "labelme" if path.is_dir() else _BY_SUFFIX.get(path.suffix.lower())
    if kind is None:
        raise InputError(f"{path}: COCO ends in .json, CVAT in .xml, and LabelMe is a folder; unpack an archive first")
    return READERS[kind](path)
