"""Many images of a few places: real photographs, or campus views, seen again from elsewhere and in another light.

A map of M images needs more photographs than there are at hand. Session 0 shows the base images as they are; every
later session walks past all of them again, each under a random homography and photometric change of its own. Views are
640 × 480, and everything about them is decided by (session, place).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from fdslam.bow.orb import extract
from fdslam.config import Orb
from fdslam.data.campus import World
from fdslam.data.images import read_image
from fdslam.progress import in_parallel
from fdslam.types import Features, Image

HEIGHT, WIDTH, KEYPOINTS = 480, 640, 1490
MAP_FOLDERS = ("camvid_changes/map", "stromovka_winter/map", "stromovka_cross/map", "stromovka_cross/query")
QUERY_FOLDERS = ("camvid_generic/query", "stromovka_winter/query")
CAMPUS_VIEWS = 128
Load = Callable[[], Image]


@dataclass(frozen=True)
class Places:
    """The base images of a map and of the queries, read when asked for."""

    name: str
    map: list[Load]
    query: list[Load]


def _cropped(image: Image) -> Image:
    """Return the middle of the image at 4 : 3, resized to 640 × 480."""
    height, width = image.shape[:2]
    h, w = min(height, width * HEIGHT // WIDTH), min(width, height * WIDTH // HEIGHT)
    top, left = (height - h) // 2, (width - w) // 2
    part = np.ascontiguousarray(image[top : top + h, left : left + w])
    return np.asarray(cv2.resize(part, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA), np.uint8)


def places(root: Path) -> Places:
    """Return the real places under ``root``; where there are none, views of the campus."""
    if all((root / folder).is_dir() for folder in (*MAP_FOLDERS, *QUERY_FOLDERS)):

        def files(folders: tuple[str, ...]) -> list[Load]:
            return [partial(read_image, path) for folder in folders for path in sorted((root / folder).glob("*.jpg"))]

        return Places("real images", files(MAP_FOLDERS), files(QUERY_FOLDERS))
    world = World(0, 4 * CAMPUS_VIEWS, WIDTH, HEIGHT)
    sessions = [[partial(_view, world, name, i) for i in range(CAMPUS_VIEWS)] for name in ("SU", "AU")]
    return Places("campus views", *sessions)


def _view(world: World, session: str, index: int) -> Image:
    return world.view(session, index).image


def seen_again(image: Image, rng: np.random.Generator) -> Image:
    """Return the image from a little elsewhere (corners moved by up to 6 % of the width) and in another light."""
    corners = np.array([[0, 0], [WIDTH, 0], [WIDTH, HEIGHT], [0, HEIGHT]], np.float32)
    moved = corners + rng.uniform(-0.06, 0.06, (4, 2)).astype(np.float32) * WIDTH
    warp = cv2.getPerspectiveTransform(corners, moved.astype(np.float32))
    warped = cv2.warpPerspective(image, warp, (WIDTH, HEIGHT), borderMode=cv2.BORDER_REFLECT_101)
    gamma, gain, offset = rng.uniform(0.7, 1.4), rng.uniform(0.8, 1.2), rng.uniform(-15, 15)
    lit = 255 * (warped / 255.0) ** gamma * gain + offset + rng.normal(0, rng.uniform(0, 6), warped.shape)
    return np.clip(np.rint(lit), 0, 255).astype(np.uint8)


def view(base: list[Load], index: int, seed: int = 0) -> Image:
    """Return view ``index``: place ``index`` mod the number of places, session ``index`` over it."""
    session, place = divmod(index, len(base))
    image = _cropped(base[place]())
    return image if session == 0 else seen_again(image, np.random.default_rng([seed, session, place]))


def features(base: list[Load], indices: range, workers: int, seed: int = 0) -> Iterator[Features]:
    """Yield the ORB features of the views, in order, extracted in threads a batch at a time."""
    config = Orb(features=KEYPOINTS)

    def one(index: int) -> tuple[int, Features]:
        return index, extract(view(base, index, seed), config)

    for begin in range(indices.start, indices.stop, 64):
        batch = range(begin, min(begin + 64, indices.stop))
        found = dict(in_parallel((partial(one, i) for i in batch), workers))
        yield from (found[i] for i in batch)
