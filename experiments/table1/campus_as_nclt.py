"""Write the embedded campus as a folder with NCLT, so that what reads NCLT can be tried, and held against the campus.

    python -m experiments.table1.campus_as_nclt DIR
    python -m fdslam.run +experiment=table1 dataset=nclt dataset.root=DIR dataset.every=0

The images are raw, that is lying on their side, as the cameras of NCLT take them.
"""

from __future__ import annotations

import argparse
import datetime
import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pillow

from fdslam.config import Campus
from fdslam.data.campus import World
from fdslam.data.embedded import load_campus
from fdslam.data.images import read_image
from fdslam.data.nclt.poses import MICROSECONDS
from fdslam.data.nclt.sessions import SEASONS
from fdslam.errors import InputError
from fdslam.store import Store
from fdslam.types import Frame


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


def write_session(root: Path, date: str, shots: Mapping[int, Shot], camera: str = "Cam5") -> None:
    """Write the images (by their place in it) and the poses of a session, in the layout of the published archives."""
    folder = root / date / "lb3" / camera
    folder.mkdir(parents=True)
    (root / "ground_truth").mkdir(exist_ok=True)
    lines = []
    for i, shot in shots.items():
        stamp = utime(date, i)
        x, y, heading = shot.pose
        lines.append(f"{stamp},{x:.12f},{y:.12f},0.0,0.0,0.0,{heading:.12f}\n")
        Pillow.fromarray(np.ascontiguousarray(np.rot90(shot.image))).save(folder / f"{stamp}.tiff")
    (root / "ground_truth" / f"groundtruth_{date}.csv").write_text("".join(lines))


def write_annotations(root: Path, query: str, map: str, shots: Mapping[int, Shot]) -> None:
    """Write the changed objects of the queries (by their place in session ``query``) against session ``map``."""
    images, annotations = [], []
    for i, shot in shots.items():
        height, width = shot.image.shape[:2]
        name = f"{query}/lb3/Cam5/{utime(query, i)}.tiff"
        images.append({"id": i, "file_name": name, "width": width, "height": height})
        for x0, y0, x1, y1 in shot.boxes.tolist():
            box = [x0, y0, x1 - x0, y1 - y0]
            annotations.append({"id": len(annotations), "image_id": i, "category_id": 0, "bbox": box})
    coco = {"images": images, "annotations": annotations, "categories": [{"id": 0, "name": "change"}]}
    (root / "annotations").mkdir(exist_ok=True)
    (root / "annotations" / f"{query}_{map}.json").write_text(json.dumps(coco, indent=1))


def write_campus(root: Path, settings: Campus, store: Store, workers: int = 0) -> None:
    """Write the campus of ``settings`` as NCLT: every session of its pairs, and what is annotated for each pair."""
    pairs = load_campus(settings, store, workers)
    world = World(settings.seed, settings.images, settings.width, settings.height)
    nothing = np.zeros((0, 4), np.float32)

    def shot(session: str, frame: Frame, boxes: NDArray[np.float32]) -> tuple[int, Shot]:
        index = int(Path(frame.name).stem)
        camera = world.camera(session, index)
        return index, Shot(read_image(frame.path), (camera.x, camera.y, camera.heading), boxes)

    maps = {one.pair[1]: one.map for one in pairs if one.pair}
    queries = {one.pair[0]: one.query for one in pairs if one.pair}
    for session in {**maps, **queries}:  # where a session is never a map, only its queries are known
        shots = dict(shot(session, frame, nothing) for frame in maps.get(session, queries.get(session, ())))
        write_session(root, SEASONS[session], shots)
    for one in pairs:
        query, map_ = one.pair or ("", "")
        annotated = zip(one.query, one.boxes or (), strict=True)
        write_annotations(root, SEASONS[query], SEASONS[map_], dict(shot(query, *each) for each in annotated))


def main() -> None:
    """Write the campus to the folder that the command line names."""
    parser = argparse.ArgumentParser(description="Write the embedded campus as a folder with NCLT.")
    parser.add_argument("folder", type=Path, help="made, and must not hold sessions yet")
    for name in ("seed", "images", "width", "height", "objects", "distractors"):
        parser.add_argument(f"--{name}", type=int, default=getattr(Campus, name))
    parser.add_argument("--store", default="outputs/store", help="where rendered images are kept and looked for")
    options = vars(parser.parse_args())
    folder, store = options.pop("folder"), options.pop("store")
    try:
        if folder.exists() and any(folder.iterdir()):
            raise InputError(f"{folder}: is not empty; name a new folder")
        if options["width"] > options["height"]:
            raise InputError("NCLT's upright images are portrait: give a --height of at least the --width")
        write_campus(folder, Campus(**options, all_pairs=True), Store(store))
    except InputError as error:
        print(f"campus_as_nclt: {error}", file=sys.stderr)
        sys.exit(2)
    print(f"dataset=nclt dataset.root={folder} dataset.every=0")


if __name__ == "__main__":
    main()
