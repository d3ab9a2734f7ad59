"""COCO: one JSON file with ``images``, ``annotations`` and ``categories`` (cocodataset.org, "Data format").

Read are ``images`` (id, file_name and, where given, width and height), ``annotations`` (id, image_id, category_id, bbox
as [x, y, width, height] in pixels) and ``categories`` (id, name), which may be absent. The rest is ignored.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from fdslam.data.annotations.annotation import AnnotatedImage, Annotation, finite, load_json, read_size
from fdslam.data.annotations.shapes import corners
from fdslam.errors import InputError

_DECIMALS = 9  # of a written number: x0 + width - x0 is not width to the last bit, and would not survive a round trip


def read_coco(path: Path) -> tuple[AnnotatedImage, ...]:
    """Return the images of a COCO file with their boxes.

    Raises:
        InputError: the file cannot be read or is no COCO, an annotation is of an image that is not among the images,
            or has no bbox.
    """
    coco = load_json(path, "COCO annotations")
    if "shapes" in coco and "images" not in coco:
        raise InputError(
            f"{path}: a LabelMe file; give the folder that holds it, as in dataset.annotations={path.parent}"
        )
    try:
        listed = [(str(image["id"]), str(image["file_name"]), image) for image in coco["images"]]
        names = {category["id"]: str(category["name"]) for category in coco.get("categories") or []}
        annotations = [
            (str(a["image_id"]), a.get("id", f"number {n}"), a) for n, a in enumerate(coco["annotations"], 1)
        ]
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: not COCO annotations with images and annotations ({error!r})") from error
    boxes: dict[str, list[Annotation]] = {}
    for key, _, _ in listed:
        if key in boxes:
            raise InputError(f"{path}: two images have the id {key}; each needs its own")
        boxes[key] = []
    for key, identity, annotation in annotations:
        where = f"{path}: annotation {identity}"
        if key not in boxes:
            raise InputError(f"{where} is of image {key}, which is not among its images")
        category = annotation.get("category_id")
        label = names.get(category, str(category)) if isinstance(category, int | str) else ""
        boxes[key].append(Annotation(_xyxy(where, annotation.get("bbox")), label, where))
    return tuple(
        AnnotatedImage(
            file, path.parent, read_size(where, image.get("width"), image.get("height")), tuple(boxes[key]), where
        )
        for key, file, image in listed
        for where in [f"{path}: image {key}"]
    )


def _xyxy(where: str, bbox: Any) -> tuple[float, float, float, float]:
    try:
        x, y, width, height = finite(*bbox)
        return corners(x, y, x + width, y + height)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{where} has the bbox {str(bbox)[:100]}; [x, y, width, height] in pixels is needed"
        ) from error


def coco_json(images: Iterable[AnnotatedImage], labels: Sequence[str] = ()) -> bytes:
    """Return the images and their boxes as a COCO file.

    Args:
        images: written in this order, with ids from 0; the boxes too.
        labels: in the order of their ids; labels that they lack follow, sorted.
    """
    images = list(images)
    found = {annotation.label for image in images for annotation in image.annotations}
    names = [*labels, *sorted(found - set(labels))]
    ids = {name: i for i, name in enumerate(names)}
    boxes = [(i, annotation) for i, image in enumerate(images) for annotation in image.annotations]
    annotations = []
    for n, (i, annotation) in enumerate(boxes):
        x0, y0, x1, y1 = annotation.xyxy
        bbox = [round(float(value), _DECIMALS) for value in (x0, y0, x1 - x0, y1 - y0)]
        annotations.append(
            {
                "id": n,
                "image_id": i,
                "category_id": ids[annotation.label],
                "bbox": bbox,
                "area": round(bbox[2] * bbox[3], _DECIMALS),
                "iscrowd": 0,
            }
        )
    content = {
        "images": [{"id": i, "file_name": image.file, **_size(image)} for i, image in enumerate(images)],
        "annotations": annotations,
        "categories": [{"id": i, "name": name} for i, name in enumerate(names)],
    }
    return json.dumps(content, indent=1).encode()


def _size(image: AnnotatedImage) -> dict[str, int]:
    return {} if image.size is None else {"width": image.size[0], "height": image.size[1]}
