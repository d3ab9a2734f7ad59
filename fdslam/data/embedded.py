"""The embedded world as a folder: rendered on first use, image by image, and then read like any other data set."""

from __future__ import annotations

import csv
import hashlib
import io
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from fdslam.config import Campus, Rendering, part
from fdslam.context import ensure
from fdslam.data.annotations import AnnotatedImage, Annotation, coco_json
from fdslam.data.campus import World
from fdslam.data.folder import read_folder
from fdslam.store import Arrays, Key, Stage, Store, sha256_file, write_atomically
from fdslam.types import Dataset

VIEW = Stage("campus_view", ("fdslam.data.campus", "fdslam.data.embedded"), ("numpy", "opencv-python-headless"))
KINDS = ("car", "person", "barrier", "poster", "table", "board")
_SPACING = 1.0  # drive index of successive images; places are told apart by pose, not by index


def _png(image: np.ndarray) -> bytes:
    return cv2.imencode(".png", image)[1].tobytes()


def _render(world: World, session: str, index: int, root: Path) -> Arrays:
    view = world.view(session, index)
    image, labels = _png(cv2.cvtColor(view.image, cv2.COLOR_RGB2BGR)), _png(view.labels)
    write_atomically(root / session / f"{index:04d}.png", image)
    if session == "query":
        write_atomically(root / "labels" / f"{index:04d}.png", labels)
    return {
        "boxes": view.boxes,
        "kinds": np.array([KINDS.index(kind) for kind in view.kinds], np.int64),
        "pose": np.array(view.pose),
        "image": np.frombuffer(hashlib.sha256(image).digest(), np.uint8),
        "labels": np.frombuffer(hashlib.sha256(labels).digest(), np.uint8),
    }


def _torn(root: Path, session: str, index: int, view: Arrays) -> bool:
    """Tell whether a rendered file is gone or no longer what was rendered."""
    files = {"image": root / session / f"{index:04d}.png"}
    if session == "query":
        files["labels"] = root / "labels" / f"{index:04d}.png"
    return any(not p.is_file() or sha256_file(p) != view[name].tobytes().hex() for name, p in files.items())


def _csv(header: list[str], rows: list[list]) -> bytes:
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows([header, *rows])
    return text.getvalue().encode()


def _pose_rows(session: str, views: list[Arrays]) -> list[list]:
    return [
        [f"{session}/{i:04d}.png", "campus", i * _SPACING, *(f"{value:.6f}" for value in view["pose"])]
        for i, view in enumerate(views)
    ]


def _coco(settings: Campus, views: list[Arrays], root: Path) -> bytes:
    images = []
    for i, view in enumerate(views):
        boxes = zip(view["boxes"].tolist(), view["kinds"], strict=True)
        found = tuple(Annotation(tuple(box), KINDS[kind], f"view {i}") for box, kind in boxes)
        images.append(AnnotatedImage(f"query/{i:04d}.png", root, (settings.width, settings.height), found, f"view {i}"))
    return coco_json(images, KINDS)


def load_campus(settings: Campus, store: Store, workers: int) -> tuple[Dataset, ...]:
    """Return the campus, rendering into the store whatever is missing there or damaged."""
    look = part(settings, Rendering)
    key = VIEW.key(look, [])
    root = store.root / "campus" / key[:16]
    world: list[World] = []

    def render(session: str, index: int) -> Arrays:
        return _render(world[0], session, index, root)

    counts = {"map": settings.map_images, "query": settings.query_images}
    addresses: dict[tuple[str, int], Key] = {
        (session, i): VIEW.key(look, [session, str(i)]) for session, count in counts.items() for i in range(count)
    }
    for (session, index), address in addresses.items():
        view = store.get(VIEW, address)
        if view is not None and _torn(root, session, index, view):
            store.path(VIEW, address).unlink(missing_ok=True)
    jobs = {address: partial(render, *which) for which, address in addresses.items()}
    if not all(store.has(VIEW, address) for address in jobs):
        world.append(World(settings.seed, settings.map_images, settings.query_images, settings.width, settings.height))
        ensure(store, VIEW, jobs, workers, "rendering the campus")
    views = {which: store.get(VIEW, address) or render(*which) for which, address in addresses.items()}
    maps = [views["map", i] for i in range(settings.map_images)]
    queries = [views["query", i] for i in range(settings.query_images)]
    pose = ["drive", "index", "x", "y", "heading"]
    files = {
        "map.csv": _csv(["map_file", *pose], _pose_rows("map", maps)),
        "pairs.csv": _csv(["query_file", "drive", "query_index", *pose[2:]], _pose_rows("query", queries)),
        "annotations.json": _coco(settings, queries, root),
    }
    for name, data in files.items():
        if not (root / name).is_file() or (root / name).read_bytes() != data:
            write_atomically(root / name, data)
    return (read_folder(root, settings, name="campus"),)
