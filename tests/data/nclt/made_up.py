"""A made-up pair of sessions in the layout of NCLT, from textures: the map in summer, the queries in autumn."""

import json

import numpy as np

from experiments.table1.campus_as_nclt import Shot, utime, write_annotations, write_session
from tests.data.worlds import texture

MAP, QUERY = "2012-08-04", "2012-11-17"
BOX = [40, 60, 80, 100]  # of the patch in a changed query, on the upright image


def shots(count=6, changed=(), light=1.0):
    """Return ``count`` upright places 10 m apart, with a pasted patch where changed."""
    found = []
    for i in range(count):
        image = (texture(i, 160, 120) * light).astype(np.uint8)
        if i in changed:
            image[60:100, 40:80] = texture(100 + i, 160, 120)[60:100, 40:80]
        boxes = np.array([BOX] if i in changed else [], np.float32).reshape(-1, 4)
        found.append(Shot(image, (10.0 * i, 0.0, 0.0), boxes))
    return found


def made_up(root, changed=(1, 3)):
    """Write both sessions, and annotations of every query, to ``root``."""
    write_session(root, MAP, dict(enumerate(shots())))
    write_session(root, QUERY, dict(enumerate(shots(changed=changed, light=0.8))))
    write_annotations(root, QUERY, MAP, dict(enumerate(shots(changed=changed))))
    return root


def image(root, date, index):
    return root / date / "lb3" / "Cam5" / f"{utime(date, index)}.tiff"


def poses(root, date):
    return root / "ground_truth" / f"groundtruth_{date}.csv"


def annotations(root):
    return root / "annotations" / f"{QUERY}_{MAP}.json"


def change(root, edit):
    coco = json.loads(annotations(root).read_text())
    edit(coco)
    annotations(root).write_text(json.dumps(coco))
