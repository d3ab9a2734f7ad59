"""Views of many campuses with every object framed: what the detector and the segmentation are trained on.

``World.view`` frames the objects that come and go, since only they can be changes. A detector has to find a parked car
as well as one that was not there yesterday, so here the things that stand still are numbered and framed too. What is
rendered is kept in a folder outside the repository, a file for each campus and session, and made again if it is gone.
"""

from __future__ import annotations

import hashlib
import inspect
import io
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import fdslam.data.campus
from fdslam.data.campus import SESSIONS, World, assets, ground
from fdslam.data.campus.camera import Camera
from fdslam.data.campus.layout import Thing, moved
from fdslam.data.campus.light import photograph
from fdslam.data.campus.objects import KINDS
from fdslam.data.campus.raster import SS, Buffers, paint, resolve
from fdslam.data.campus.scene import SKY
from fdslam.data.campus.seasons import SEASONS
from fdslam.data.campus.seeds import stream
from fdslam.data.campus.world import LEAST_AREA, LEAST_PIXELS, LEAST_SHARE, Day
from fdslam.store import write_atomically

CLASSES = (*KINDS, "bicycle", "bench", "bin", "sign")  # KINDS come and go; the others, and parked cars, always stand
TRAINING, VALIDATION, TEST = tuple(range(1000, 1012)), (2000, 2001), (3002, 3003)  # never 4, the world of the users
LOOP = 96  # images of a session that go around the whole path
HEIGHT, WIDTH = 404, 308  # pixels of a view
STORE = Path("outputs/train")


@dataclass(frozen=True)
class Views:
    """Views of one campus in one session."""

    images: NDArray[np.uint8]  # [n, H, W, 3] RGB
    labels: NDArray[np.uint8]  # [n, H, W] indices into fdslam.types.LABELS
    indoors: NDArray[np.bool_]  # [n] taken in the passage
    view: NDArray[np.int64]  # [m] which of the views an object is in, rising
    classes: NDArray[np.int64]  # [m] indices into CLASSES
    boxes: NDArray[np.float32]  # [m, 4] xyxy half-open pixels, the visible extent
    clear: NDArray[np.bool_]  # [m] enough of the object is to be seen to ask for it

    def of(self, view: int) -> tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.bool_]]:
        """Return classes [k], boxes [k, 4] and clear [k] of one view."""
        mine = self.view == view
        return self.classes[mine], self.boxes[mine], self.clear[mine]


class FramedWorld(World):
    """A campus whose cars, bicycles, benches, bins and signs are numbered after the objects of ``World.items``."""

    def day(self, session: str) -> Day:
        """Return the campus of a session, its things numbered by their place in ``moved``."""
        made = session in self._days
        day = super().day(session)
        if made:
            return day
        placed = moved(self.layout, self.seed, session)
        quads: dict[str, int] = {}
        for t in placed:
            if t.kind not in quads:
                quads[t.kind] = len(assets.things([t], self.seed, session, day.season))
        items = [
            len(self.items) + k if t.kind in CLASSES else -1 for k, t in enumerate(placed) for _ in range(quads[t.kind])
        ]
        first = len(assets.buildings(self.layout, self.seed, session, day.season))
        number = day.mesh.item.copy()
        if len(number) != first + len(items):
            raise ValueError(f"the things of {session} have {len(number) - first} quads and not {len(items)}")
        number[first:] = items
        day = self._days[session] = replace(day, mesh=replace(day.mesh, item=number))
        return day

    def framed(self, session: str, index: int) -> Views:
        """Return the image ``World.view`` makes, with all objects framed."""
        camera = self.camera(session, index)
        static = self.static(session, camera)
        buffers, clear = self.populate(session, camera, static)
        placed: Sequence[Thing] = moved(self.layout, self.seed, session)
        kinds = {k: self.items[k].kind for k in clear}
        clear |= self._things(session, camera, buffers, len(placed))
        kinds |= {k: placed[k - len(self.items)].kind for k in clear if k >= len(self.items)}
        contacts = [[*self.items[k].at, 0.75 * self.items[k].radius] for k in clear if k < len(self.items)]
        ground.darken(buffers, camera, np.array([c for c in contacts if c[2]]).reshape(-1, 3))
        seen = resolve(buffers)
        image = photograph(
            seen.color, seen.depth, SEASONS[session].light, stream(self.seed, "photograph", session, index)
        )
        numbers = list(clear)
        return Views(
            image[None],
            seen.label[None],
            np.array([bool(self.layout.passage.inside(np.array([camera.x, camera.y])))]),
            np.zeros(len(numbers), np.int64),
            np.array([CLASSES.index(kinds[k]) for k in numbers], np.int64),
            buffers.boxes(numbers),
            np.array([clear[k] for k in numbers], bool),
        )

    def _things(self, session: str, camera: Camera, buffers: Buffers, count: int) -> dict[int, bool]:
        """Return the numbers of the things of which anything is to be seen, and whether they are clearly seen."""
        mesh, first = self.day(session).mesh, len(self.items)
        owned = buffers.count(first + count)
        least = SS * SS * max(LEAST_PIXELS, LEAST_AREA * self.width * self.height)
        shape = buffers.inverse.shape
        clear = {}
        for k in (first + np.flatnonzero(owned[first:])).tolist():
            clear[k] = owned[k] >= least
            if clear[k]:
                alone = Buffers(
                    np.zeros_like(buffers.color), np.zeros(shape, np.float32), np.zeros(shape, np.int32), [SKY], [-1]
                )
                mine = np.flatnonzero(mesh.item == k)
                arrays = {name: value[mine] for name, value in vars(mesh).items() if name != "textures"}
                part = replace(mesh, **arrays, textures=tuple(mesh.textures[q] for q in mine))
                paint(alone, camera, part, np.ones((len(mine), 3)))
                clear[k] = owned[k] >= LEAST_SHARE * np.count_nonzero(alone.quad)
        return clear


def joined(parts: Sequence[Views]) -> Views:
    """Put views one after the other."""
    starts = np.cumsum([0] + [len(p.images) for p in parts])
    view = np.concatenate([p.view + s for p, s in zip(parts, starts, strict=False)])
    rest = ("images", "labels", "indoors", "classes", "boxes", "clear")
    return Views(view=view, **{name: np.concatenate([getattr(p, name) for p in parts]) for name in rest})


def _source() -> str:
    """Return a digest of everything that decides a view."""
    files = sorted(Path(fdslam.data.campus.__path__[0]).glob("*.py"))
    parts = [f.read_bytes() for f in files] + [inspect.getsource(FramedWorld).encode(), repr(CLASSES).encode()]
    return hashlib.sha256(b"".join(parts)).hexdigest()[:12]


def _path(store: Path, seed: int, session: str, every: int, height: int, width: int) -> Path:
    return store / "views" / f"{seed}_{session}_{every}_{width}x{height}_{_source()}.npz"


def render(store: Path, every: int, height: int, width: int, seed: int) -> None:
    """Render the views of one campus that are not in the store."""
    world = FramedWorld(seed, LOOP * len(SESSIONS), width, height)
    for session in SESSIONS:
        path = _path(store, seed, session, every, height, width)
        if not path.is_file():
            views = joined([world.framed(session, i) for i in range(0, LOOP, every)])
            data = io.BytesIO()
            np.savez(data, **vars(views))
            write_atomically(path, data.getbuffer())


def load(
    store: Path, seeds: Sequence[int], every: int, height: int = HEIGHT, width: int = WIDTH, workers: int = 1
) -> dict[str, Views]:
    """Return the views of some campuses by session, rendering what is missing.

    Args:
        store: folder that keeps them.
        seeds: of the campuses.
        every: how many of the LOOP images of a session are passed over from one view to the next, and one more.
        height: of a view, pixels.
        width: of a view, pixels.
        workers: processes that render.
    """
    missing = [
        seed for seed in seeds if not all(_path(store, seed, name, every, height, width).is_file() for name in SESSIONS)
    ]
    job = partial(render, store, every, height, width)
    if workers > 1 and len(missing) > 1:
        with ProcessPoolExecutor(workers) as pool:
            list(pool.map(job, missing))
    else:
        for seed in missing:
            job(seed)
    found: dict[str, Views] = {}
    for session in SESSIONS:
        parts = []
        for seed in seeds:
            with np.load(_path(store, seed, session, every, height, width), allow_pickle=False) as file:
                parts.append(Views(**{name: file[name] for name in file.files}))
        found[session] = joined(parts)
    return found
