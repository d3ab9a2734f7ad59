"""A path along a wall: map images that see parts of what their neighbours see, and queries between them."""

import json
from dataclasses import replace

import numpy as np
from PIL import Image

from fdslam.config import Bow, Compact, Config, Early, Evaluation, Folder, Mix, Obb, Report
from tests.data.worlds import texture

STEP = 24  # pixels from a view to the next
HEIGHT, WIDTH = 120, 160
PATCH = (30, 40, 80, 100)  # y0, x0, y1, x1 of what is new in a query


def walk(root, count=12, changed=(1, 3)):
    """Write a data set of ``count`` map images and four queries, with something new in those ``changed``."""
    for folder in ("map", "query"):
        (root / folder).mkdir(parents=True)
    wall = texture(0, HEIGHT, WIDTH + STEP * count)
    for i in range(count):
        Image.fromarray(wall[:, STEP * i : STEP * i + WIDTH]).save(root / "map" / f"{i:02d}.png")
    images, annotations = [], []
    for q in range(4):
        begin = STEP * (q * (count - 1) // 4) + STEP // 3
        view = (wall[:, begin : begin + WIDTH] * 0.85).astype(np.uint8)
        if q in changed:
            y0, x0, y1, x1 = PATCH
            view[y0:y1, x0:x1] = texture(50 + q)[y0:y1, x0:x1]
            box = [x0, y0, x1 - x0, y1 - y0]
            annotations.append({"id": len(annotations), "image_id": q, "category_id": 0, "bbox": box})
        Image.fromarray(view).save(root / "query" / f"{q}.png")
        images.append({"id": q, "file_name": f"query/{q}.png", "width": WIDTH, "height": HEIGHT})
    coco = {"images": images, "annotations": annotations, "categories": [{"id": 0, "name": "new"}]}
    (root / "annotations.json").write_text(json.dumps(coco))
    return root


def config_for(root, store, **changes):
    plain = Config(
        store=str(store),
        workers=1,
        dataset=Folder(root=str(root)),
        obb=Obb("J+B"),
        bow=Bow(features=300, min_side=240),
        compact=Compact(source="gradients"),
        early=Early(model="map", trees=15, leaves=8, leaf=20),
        mix=Mix(rows=["CC", "WC", "MW", "EF", "FD", "FD+CC"]),
        evaluation=Evaluation(bootstrap=10),
        report=Report(pictures=0),
    )
    return replace(plain, **changes)
