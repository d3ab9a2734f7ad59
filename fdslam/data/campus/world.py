"""The campus: two sessions on one path, each image made on demand from (seed, session, index) alone."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus import assets, ground, sky
from fdslam.data.campus.camera import Camera
from fdslam.data.campus.changes import Change, meet, pedestrian
from fdslam.data.campus.flora import AUTUMN, SUMMER
from fdslam.data.campus.ground import Ground
from fdslam.data.campus.layout import layout
from fdslam.data.campus.light import EVENING, NOON, Light, gains, photograph
from fdslam.data.campus.raster import SS, Buffers, paint, resolve
from fdslam.data.campus.route import pose, route
from fdslam.data.campus.scene import GROUND, SKY, Mesh, mesh
from fdslam.data.campus.seeds import stream

LEAST_AREA = 5e-4  # share of the image: a change object with less to see is left out
LEAST_PIXELS = 12  # the same in pixels, for small images
LEAST_SHARE = 0.25  # of the object's own outline in the image: one that is hidden more is left out
MOST = 5  # change objects in a query


@dataclass(frozen=True)
class View:
    """An image and what is true of it."""

    image: NDArray[np.uint8]  # [H, W, 3] RGB
    labels: NDArray[np.uint8]  # [H, W] indices into LABELS
    depth: NDArray[np.float32]  # [H, W] metres along the optical axis, inf in the sky
    boxes: NDArray[np.float32]  # [n, 4] xyxy half-open pixels, visible extent of the change objects
    kinds: tuple[str, ...]  # [n] "car", "person", "barrier", "poster", "table", "board"
    pose: tuple[float, float, float]  # x, y metres, heading radians


@dataclass(frozen=True)
class Session:
    """The campus as it is on one day."""

    mesh: Mesh
    ground: Ground
    sky: NDArray[np.uint8]  # panorama
    light: Light


class World:
    """A seeded campus with a map session and a query session.

    Every third query (index % 3 == 2) meets no change object; every other meets at least one.

    Args:
        seed: which campus.
        map_images: number of map images, along the path.
        query_images: number of query images, along the same stretch of the path.
        width: image width, pixels.
        height: image height, pixels.
    """

    def __init__(self, seed: int, map_images: int, query_images: int, width: int, height: int) -> None:
        self.seed, self.map_images, self.query_images = seed, map_images, query_images
        self.width, self.height = width, height
        self.route = route(seed)
        self.layout = layout(seed, self.route)
        self._sessions: dict[str, Session] = {}
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[type[World], tuple[int, int, int, int, int]]:
        """Travel to other processes as the arguments only."""
        return World, (self.seed, self.map_images, self.query_images, self.width, self.height)

    def camera(self, session: str, index: int) -> Camera:
        """Return the camera of an image."""
        x, y, heading = pose(self.route, self.seed, session, index, self.map_images, self.query_images)
        return Camera(self.width, self.height, x, y, heading)

    def session(self, name: str) -> Session:
        """Return the campus of a session, made on first use."""
        with self._lock:
            if name not in self._sessions:
                season, light = (SUMMER, NOON) if name == "map" else (AUTUMN, EVENING)
                quads = assets.buildings(self.layout, self.seed) + assets.things(self.layout, self.seed, name, season)
                soil = assets.ground(self.layout, self.route, self.seed, name, season, light)
                above = sky.panorama(stream(self.seed, "sky", name), light)
                self._sessions[name] = Session(mesh(quads), soil, above, light)
            return self._sessions[name]

    def static(self, session: str, camera: Camera) -> Buffers:
        """Render the world of a session without change objects."""
        day = self.session(session)
        first, below = ground.view(camera, day.ground, day.light)
        color = np.concatenate([sky.view(camera, day.sky, first), below])
        v = (np.arange(self.height * SS) + 0.5) / SS
        inverse = np.where(v >= first, (v - camera.center[1]) / (camera.focal * camera.eye), 0).astype(np.float32)
        shape = self.height * SS, self.width * SS
        buffers = Buffers(
            color.repeat(SS, 0).repeat(SS, 1),
            np.ascontiguousarray(np.broadcast_to(inverse[:, None], shape)),
            np.ascontiguousarray(np.broadcast_to((v >= first).astype(np.int32)[:, None], shape)),
            [SKY, GROUND],
            [-1, -1],
        )
        paint(buffers, camera, day.mesh, gains(day.mesh, day.light, camera.position))
        return buffers

    def add(self, buffers: Buffers, camera: Camera, changes: Sequence[Change]) -> Buffers:
        """Return a copy of ``buffers`` in which change objects, numbered in this order, stand in the query session."""
        out = buffers.copy()
        for k, change in enumerate(changes):
            part = mesh(change.quads, [k] * len(change.quads))
            paint(out, camera, part, gains(part, self.session("query").light, camera.position))
        return out

    def keep(self, static: Buffers, camera: Camera, candidates: Sequence[Change]) -> tuple[list[Change], Buffers]:
        """Leave out the candidates of which too little is to be seen when they all stand together.

        An object stays if it owns LEAST_AREA of the image, LEAST_PIXELS pixels (both by its samples), and LEAST_SHARE
        of what it would own if nothing stood before it.

        Returns:
            The objects that stay, in their order, and the buffers with them.
        """
        shape = static.inverse.shape
        nothing = np.zeros(shape, np.float32), np.zeros(shape, np.int32)
        blank = Buffers(np.zeros_like(static.color), *nothing, [SKY], [-1])
        least = SS * SS * max(LEAST_PIXELS, LEAST_AREA * self.width * self.height)
        outline = [self.add(blank, camera, [c]).count(1)[0] for c in candidates]
        kept = [(c, max(least, LEAST_SHARE * n)) for c, n in zip(candidates, outline, strict=True) if n >= least]
        while True:
            out = self.add(static, camera, [c for c, _ in kept])
            enough = [n >= need for n, (_, need) in zip(out.count(len(kept)), kept, strict=True)]
            if all(enough):
                return [c for c, _ in kept], out
            kept = [pair for pair, stays in zip(kept, enough, strict=True) if stays]

    def populate(self, index: int, camera: Camera, static: Buffers) -> tuple[list[Change], Buffers]:
        """Return the change objects of a query and the buffers with them."""
        if index % 3 == 2:
            return [], static
        for attempt in range(4):
            rng = stream(self.seed, "changes", index, attempt)
            candidates = meet(rng, self.layout, camera, int(rng.integers(1, MOST + 1)))
            kept, buffers = self.keep(static, camera, candidates)
            if kept:
                return kept, buffers
        someone = [pedestrian(stream(self.seed, "pedestrian", index), camera)]
        return someone, self.add(static, camera, someone)

    def view(self, session: str, index: int) -> View:
        """Return one image; the same bytes in any process, thread and order.

        Args:
            session: "map" or "query".
            index: 0 <= index < the session's number of images.

        Raises:
            IndexError: there is no such image.
        """
        count = {"map": self.map_images, "query": self.query_images}[session]
        if not 0 <= index < count:
            raise IndexError(f"{session} image {index}: there are {count}")
        camera = self.camera(session, index)
        buffers = self.static(session, camera)
        changes: list[Change] = []
        if session == "query":
            changes, buffers = self.populate(index, camera, buffers)
            ground.darken(buffers, camera, np.array([[*c.at, c.shade] for c in changes if c.shade]).reshape(-1, 3))
        seen = resolve(buffers)
        light = self.session(session).light
        image = photograph(seen.color, seen.depth, light, stream(self.seed, "photograph", session, index))
        kinds = tuple(c.kind for c in changes)
        return View(
            image, seen.label, seen.depth, buffers.boxes(len(changes)), kinds, (camera.x, camera.y, camera.heading)
        )
