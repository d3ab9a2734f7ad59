"""What was found in live images, for programs: COCO's boxes, and where each image was taken."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fdslam.boxes import Candidate
from fdslam.detection import Detection

CATEGORY = {"id": 1, "name": "change"}


def findings(found: Sequence[tuple[Detection, Sequence[Candidate]]], about: dict[str, Any]) -> dict[str, Any]:
    """Return COCO detections, JSON-able; each image also says where it was taken.

    Args:
        found: every image's detection and candidate boxes, best first.
        about: what the boxes were made with.

    Returns:
        ``info``, ``images`` (id, file_name, width, height, lost, hypotheses with image and relevance, best first),
        ``annotations`` (id, image_id, category_id, bbox as x, y, width, height in pixels, area, iscrowd, score) and
        ``categories``.
    """
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for number, (one, boxes) in enumerate(found, 1):
        hypotheses = [{"image": h.name, "relevance": round(h.relevance, 6)} for h in one.hypotheses]
        images.append(
            {
                "id": number,
                "file_name": one.name,
                "width": one.width,
                "height": one.height,
                "lost": one.lost,
                "hypotheses": hypotheses,
            }
        )
        for box in boxes:
            x0, y0, x1, y1 = (float(value) for value in box.xyxy)
            annotations.append(
                {
                    "id": len(annotations) + 1,
                    "image_id": number,
                    "category_id": CATEGORY["id"],
                    "bbox": [x0, y0, x1 - x0, y1 - y0],
                    "area": (x1 - x0) * (y1 - y0),
                    "iscrowd": 0,
                    "score": round(box.score, 6),
                }
            )
    return {"info": about, "images": images, "annotations": annotations, "categories": [CATEGORY]}
