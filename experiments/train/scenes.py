"""Images with the boxes of their objects to train on: views of the embedded world, or any data set."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from fdslam.compose import configured
from fdslam.data import check_dataset, load_datasets
from fdslam.data.campus import SESSIONS, World
from fdslam.data.images import read_image
from fdslam.errors import InputError
from fdslam.obb.bing.training import Scene
from fdslam.progress import in_parallel, progress
from fdslam.store import Store
from fdslam.types import Dataset, Frame

HEIGHT, WIDTH = 404, 308  # pixels, the campus camera


def campus_scenes(seeds: Sequence[int], images: int, workers: int) -> Iterator[Scene]:
    """Yield ``images`` views of each campus, all four sessions and all objects, rendered on the way.

    An object too small or too hidden for an annotation (World.populate) is ignored: neither right nor wrong.
    """
    for seed in seeds:
        world = World(seed, images, WIDTH, HEIGHT)
        at = [(session, i) for session in SESSIONS for i in range(world.count[session])]
        jobs = (partial(_numbered, world, number, *place) for number, place in enumerate(at))
        seen = progress(in_parallel(jobs, workers), len(at), f"campus {seed}")
        yield from (scene for _, scene in sorted(seen, key=lambda pair: pair[0]))


def _numbered(world: World, number: int, session: str, index: int) -> tuple[int, Scene]:
    view = world.view(session, index)
    return number, Scene(view.image, view.boxes[view.clear], view.boxes[~view.clear])


def load(overrides: Sequence[str], workers: int) -> tuple[Dataset, ...]:
    """Return the data sets that words of the command line name, e.g. ``dataset=folder dataset.root=DIR``."""
    config = configured(overrides)
    check_dataset(config.dataset)
    return load_datasets(config.dataset, Store(config.store), workers)


def annotated_scenes(sets: Sequence[Dataset]) -> Iterator[Scene]:
    """Yield the queries of data sets with all that is annotated in each; one that is in several sets comes once.

    Raises:
        InputError: a data set without annotations.
    """
    frames: dict[str, Frame] = {}
    boxes: dict[str, list[np.ndarray]] = {}
    for data in sets:
        if data.boxes is None:
            raise InputError(f"{data.name}: has no annotations; boxes of objects are needed here")
        for frame, objects in zip(data.query, data.boxes, strict=True):
            frames[frame.digest] = frame
            boxes.setdefault(frame.digest, []).append(objects)
    none = np.empty((0, 4), np.float32)
    for digest, frame in frames.items():
        yield Scene(read_image(frame.path), np.unique(np.concatenate([none, *boxes[digest]]), axis=0), none)
