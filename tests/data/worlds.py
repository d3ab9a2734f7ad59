"""A small data set on disk, in the folder layout, for tests of readers and of the whole way."""

import csv
import json

import numpy as np
from PIL import Image


def texture(seed, height=120, width=160):
    """A picture full of corners: blocks of random grey at three scales."""
    rng = np.random.default_rng(seed)
    image = np.zeros((height, width, 3))
    for size in (4, 8, 16):
        shape = (height // size + 1, width // size + 1, 3)
        blocks = np.kron(rng.integers(0, 86, shape), np.ones((size, size, 1)))
        image += blocks[:height, :width]
    return image.astype(np.uint8)


def write_csv(path, header, rows):
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([header, *rows])


def small_world(root, count=6, changed=(1, 3), light=0.8, name="{:02d}"):
    """Write ``count`` places: the map as it is, the queries in another light, with a pasted patch where changed."""
    names = [f"{name.format(i)}.png" for i in range(count)]
    for folder in ("map", "query", "labels"):
        (root / folder).mkdir(parents=True)
    images, annotations = [], []
    for i in range(count):
        place = texture(i)
        Image.fromarray(place).save(root / "map" / names[i])
        query = (place * light).astype(np.uint8)
        labels = np.full(query.shape[:2], 2, np.uint8)
        labels[:30] = 0  # sky
        if i in changed:
            query[60:100, 40:80] = texture(100 + i)[60:100, 40:80]
            labels[60:100, 40:80] = 4
            annotations.append({"id": len(annotations), "image_id": i, "category_id": 0, "bbox": [40, 60, 40, 40]})
        Image.fromarray(query).save(root / "query" / names[i])
        Image.fromarray(labels).save(root / "labels" / names[i])
        images.append({"id": i, "file_name": f"query/{names[i]}", "width": 160, "height": 120})
    coco = {"images": images, "annotations": annotations, "categories": [{"id": 0, "name": "patch"}]}
    (root / "annotations.json").write_text(json.dumps(coco))
    write_csv(
        root / "map.csv", ["map_file", "drive", "index"], [[f"map/{names[i]}", "d", 10 * i] for i in range(count)]
    )
    rows = [[f"query/{names[i]}", f"map/{names[i]}", "d", 10 * i] for i in range(count)]
    write_csv(root / "pairs.csv", ["query_file", "map_file", "drive", "query_index"], rows)
    return root
