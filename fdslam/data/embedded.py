"""The embedded world as data sets: its sessions are rendered on first use, and joined to pairs of query and map.

The images of a session are rendered once, whatever pairs it is part of: ``AU/0001.png`` is the same file, with the same
digest, as a query against three maps and as a map image for three query sessions. What is annotated in it depends on
the map: the objects that do not stand in the map's session.
"""

from __future__ import annotations

import hashlib
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from fdslam.config import Campus, Rendering, part
from fdslam.context import ensure
from fdslam.data.campus import SESSIONS, World
from fdslam.data.campus.pairs import PAIRS, choose, shares
from fdslam.data.relevance import places_by_pose
from fdslam.errors import InputError
from fdslam.store import Arrays, Key, Stage, Store, sha256_file, write_atomically
from fdslam.types import Dataset, Frame

VIEW = Stage("campus_view", ("fdslam.data.campus", "fdslam.data.embedded"), ("numpy", "opencv-python-headless"))


def _png(image: np.ndarray) -> bytes:
    return cv2.imencode(".png", image)[1].tobytes()


def _files(root: Path, session: str, index: int) -> dict[str, Path]:
    name = f"{session}/{index:04d}.png"
    return {"image": root / name, "labels": root / "labels" / name}


def _render(world: World, root: Path, session: str, index: int) -> Arrays:
    """Write an image and its labels; return what else is true of it, and the digests of both files."""
    view = world.view(session, index)
    data = {"image": _png(cv2.cvtColor(view.image, cv2.COLOR_RGB2BGR)), "labels": _png(view.labels)}
    for name, path in _files(root, session, index).items():
        write_atomically(path, data[name])
    standing = [[name in world.items[k].sessions for name in SESSIONS] for k in view.items]
    return {
        "boxes": view.boxes,
        "clear": view.clear,
        "standing": np.array(standing, bool).reshape(-1, len(SESSIONS)),
        "pose": np.array(view.pose),
        **{name: np.frombuffer(hashlib.sha256(content).digest(), np.uint8) for name, content in data.items()},
    }


def _torn(root: Path, session: str, index: int, view: Arrays) -> bool:
    """Tell whether a rendered file is gone or no longer what was rendered."""
    files = _files(root, session, index)
    return any(not p.is_file() or sha256_file(p) != view[name].tobytes().hex() for name, p in files.items())


def _rendered(settings: Campus, sessions: list[str], root: Path, store: Store, workers: int) -> dict[str, list[Arrays]]:
    """Return what is true of the images of the sessions, rendering whatever is missing or damaged."""
    look = part(settings, Rendering)
    counts = shares(settings.images, SESSIONS)
    addresses: dict[tuple[str, int], Key] = {
        (session, i): VIEW.key(look, [session, str(i)]) for session in sessions for i in range(counts[session])
    }
    for which, address in addresses.items():
        view = store.get(VIEW, address)
        if view is not None and _torn(root, *which, view):
            store.path(VIEW, address).unlink(missing_ok=True)
    world: list[World] = []

    def render(session: str, index: int) -> Arrays:
        return _render(world[0], root, session, index)

    if not all(store.has(VIEW, address) for address in addresses.values()):
        world.append(World(settings.seed, settings.images, settings.width, settings.height))
        jobs = {address: partial(render, *which) for which, address in addresses.items()}
        ensure(store, VIEW, jobs, workers, "rendering the campus")
    views = {which: store.get(VIEW, address) or render(*which) for which, address in addresses.items()}
    return {session: [views[session, i] for i in range(counts[session])] for session in sessions}


def _frames(settings: Campus, root: Path, session: str, views: list[Arrays]) -> list[Frame]:
    digests = [view["image"].tobytes().hex() for view in views]
    paths = [_files(root, session, i)["image"] for i in range(len(views))]
    names = [path.relative_to(root).as_posix() for path in paths]
    size = settings.height, settings.width
    return [Frame(name, path, digest, *size) for name, path, digest in zip(names, paths, digests, strict=True)]


def _pair(settings: Campus, pair: tuple[str, str], root: Path, rendered: dict[str, list[Arrays]]) -> Dataset:
    """Join two sessions: the map is all images of one, the queries are chosen among those of the other."""
    query, map_ = pair
    views, maps = rendered[query], rendered[map_]
    changed = [~view["standing"][:, SESSIONS.index(map_)] for view in views]
    annotated = [change & view["clear"] for change, view in zip(changed, views, strict=True)]
    objects, distractors = (shares(n, PAIRS)[pair] for n in (settings.objects, settings.distractors))
    counts, seen = (np.array([np.count_nonzero(one) for one in many]) for many in (annotated, changed))
    chosen = choose(counts, seen, objects, distractors)
    if not chosen:
        raise InputError(
            f"dataset=campus: no image of {query} is a query against {map_}; raise dataset.images={settings.images}, "
            f"dataset.objects={settings.objects} or dataset.distractors={settings.distractors}"
        )
    poses = np.array([view["pose"] for view in maps])
    frames = _frames(settings, root, query, views)
    return Dataset(
        name="campus",
        map=tuple(_frames(settings, root, map_, maps)),
        query=tuple(frames[i] for i in chosen),
        boxes=tuple(views[i]["boxes"][annotated[i]] for i in chosen),
        relevant=places_by_pose(np.array([views[i]["pose"] for i in chosen]), poses, settings.radius, settings.angle),
        labels=tuple(_files(root, query, i)["labels"] for i in chosen),
        poses=poses,
        times=np.arange(len(maps), dtype=np.float64),
        pair=pair,
    )


def load_campus(settings: Campus, store: Store, workers: int) -> tuple[Dataset, ...]:
    """Return the campus, one data set for each pair of sessions that the settings name."""
    query, map_ = settings.chosen
    pairs = [(q, m) for q, m in PAIRS if query in (q, "all") and map_ in (m, "all")]
    sessions = [name for name in SESSIONS if any(name in pair for pair in pairs)]
    root = store.root / "campus" / VIEW.key(part(settings, Rendering), [])[:16]
    rendered = _rendered(settings, sessions, root, store, workers)
    return tuple(_pair(settings, pair, root, rendered) for pair in pairs)
