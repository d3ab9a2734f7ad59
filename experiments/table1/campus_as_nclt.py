"""Write the embedded campus as a folder with NCLT, so that what reads NCLT can be tried, and held against the campus.

    python -m experiments.table1.campus_as_nclt DIR
    python -m fdslam.run +experiment=fd dataset=nclt dataset.root=DIR dataset.query=AU dataset.map=SU dataset.every=0

The images are raw, that is lying on their side, as the cameras of NCLT take them.
"""

from __future__ import annotations

import argparse
import datetime
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pillow

from fdslam.config import Campus
from fdslam.data.campus import World
from fdslam.data.nclt.poses import MICROSECONDS
from fdslam.data.nclt.sessions import SEASONS

# The campus has a summer noon and an autumn evening: its sessions, the seasons they stand for, and which is the query.
SESSIONS = {"map": SEASONS["SU"], "query": SEASONS["AU"]}
PAIRS = (("query", "map"),)


@dataclass(frozen=True)
class Shot:
    """One image of a session and what is true of it."""

    image: NDArray[np.uint8]  # [H, W, 3] RGB, upright
    pose: tuple[float, float, float]  # x, y metres, heading radians
    boxes: NDArray[np.float32]  # [n, 4] xyxy of changed objects


def utime(date: str, index: int) -> int:
    """Return the time stamp of an image, µs: a second after the one before, from noon."""
    noon = datetime.datetime.fromisoformat(f"{date}T12:00:00+00:00")
    return (int(noon.timestamp()) + index) * MICROSECONDS


def write_session(root: Path, date: str, shots: Sequence[Shot], camera: str = "Cam5") -> None:
    """Write the images and the poses of a session, in the layout of the published archives."""
    folder = root / date / "lb3" / camera
    folder.mkdir(parents=True)
    (root / "ground_truth").mkdir(exist_ok=True)
    lines = []
    for i, shot in enumerate(shots):
        stamp = utime(date, i)
        x, y, heading = shot.pose
        lines.append(f"{stamp},{x:.6f},{y:.6f},0.0,0.0,0.0,{heading:.6f}\n")
        Pillow.fromarray(np.ascontiguousarray(np.rot90(shot.image))).save(folder / f"{stamp}.tiff")
    (root / "ground_truth" / f"groundtruth_{date}.csv").write_text("".join(lines))


def write_annotations(root: Path, query: str, map: str, shots: Sequence[Shot]) -> None:
    """Write the changed objects of every shot of session ``query`` against session ``map``."""
    images, annotations = [], []
    for i, shot in enumerate(shots):
        height, width = shot.image.shape[:2]
        name = f"{query}/lb3/Cam5/{utime(query, i)}.tiff"
        images.append({"id": i, "file_name": name, "width": width, "height": height})
        for x0, y0, x1, y1 in shot.boxes.tolist():
            box = [x0, y0, x1 - x0, y1 - y0]
            annotations.append({"id": len(annotations), "image_id": i, "category_id": 0, "bbox": box})
    coco = {"images": images, "annotations": annotations, "categories": [{"id": 0, "name": "change"}]}
    (root / "annotations").mkdir(exist_ok=True)
    (root / "annotations" / f"{query}_{map}.json").write_text(json.dumps(coco, indent=1))


def write_campus(root: Path, settings: Campus) -> None:
    """Render the campus of ``settings`` and write it as NCLT."""
    world = World(settings.seed, settings.map_images, settings.query_images, settings.width, settings.height)
    counts = {"map": settings.map_images, "query": settings.query_images}
    shots = {}
    for session, date in SESSIONS.items():
        views = [world.view(session, i) for i in range(counts[session])]
        shots[session] = [Shot(view.image, view.pose, view.boxes) for view in views]
        write_session(root, date, shots[session])
    for query, map in PAIRS:
        write_annotations(root, SESSIONS[query], SESSIONS[map], shots[query])


def main() -> None:
    """Write the campus to the folder that the command line names."""
    parser = argparse.ArgumentParser(description="Write the embedded campus as a folder with NCLT.")
    parser.add_argument("folder", type=Path, help="made, and must not hold sessions yet")
    for name in ("seed", "map_images", "query_images", "width", "height"):
        parser.add_argument(f"--{name.replace('_', '-')}", type=int, default=getattr(Campus, name))
    options = vars(parser.parse_args())
    folder = options.pop("folder")
    write_campus(folder, Campus(**options))
    print(f"dataset=nclt dataset.root={folder} dataset.query=AU dataset.map=SU dataset.every=0")


if __name__ == "__main__":
    main()
