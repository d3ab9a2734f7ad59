"""The campus: four sessions on one path, each image made on demand from (seed, session, index) alone."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus import assets, ground, sky
from fdslam.data.campus.camera import Camera
from fdslam.data.campus.ground import Ground
from fdslam.data.campus.layout import layout, moved
from fdslam.data.campus.light import gains, photograph
from fdslam.data.campus.objects import furnish
from fdslam.data.campus.pairs import shares
from fdslam.data.campus.raster import SS, Buffers, paint, resolve
from fdslam.data.campus.route import pose, route
from fdslam.data.campus.scene import GROUND, SKY, Mesh, mesh
from fdslam.data.campus.seasons import SEASONS, SESSIONS, Season
from fdslam.data.campus.seeds import stream
from fdslam.data.campus.terrain import terrain

LEAST_AREA = 5e-4  # share of the image: an object with less to see is not annotated
LEAST_PIXELS = 12  # the same in pixels, for small images
LEAST_SHARE = 0.25  # of the object's own outline in the image: one that is hidden more is not annotated
KEPT = 2  # sessions whose textures are held at a time: each takes some hundred MB


@dataclass(frozen=True)
class View:
    """An image and what is true of it."""

    image: NDArray[np.uint8]  # [H, W, 3] RGB
    labels: NDArray[np.uint8]  # [H, W] indices into LABELS
    depth: NDArray[np.float32]  # [H, W] metres along the optical axis, inf in the sky
    items: NDArray[np.int64]  # [n] numbers in World.items of the objects of which anything is to be seen
    boxes: NDArray[np.float32]  # [n, 4] xyxy half-open pixels, their visible extent
    clear: NDArray[np.bool_]  # [n] enough is to be seen for an annotation
    pose: tuple[float, float, float]  # x, y metres, heading radians


@dataclass(frozen=True)
class Day:
    """The campus as it is in one session, but for the objects of World.items."""

    season: Season
    mesh: Mesh
    ground: Ground
    sky: NDArray[np.uint8]  # panorama


class World:
    """A seeded campus in four sessions: WI, SP, SU and AU.

    Args:
        seed: which campus.
        images: number of images of the four sessions together; each has a quarter of them, along the path.
        width: image width, pixels.
        height: image height, pixels.
    """

    def __init__(self, seed: int, images: int, width: int, height: int) -> None:
        self.seed, self.images, self.width, self.height = seed, images, width, height
        self.count = shares(images, SESSIONS)  # images of each session
        self.route = route(seed)
        self.layout = layout(seed, self.route)
        self.items = furnish(self.layout, self.route, seed)
        self._days: OrderedDict[str, Day] = OrderedDict()
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[type[World], tuple[int, int, int, int]]:
        """Travel to other processes as the arguments only."""
        return World, (self.seed, self.images, self.width, self.height)

    def camera(self, session: str, index: int) -> Camera:
        """Return the camera of an image."""
        return Camera(self.width, self.height, *pose(self.route, self.seed, session, index, self.count[session]))

    def day(self, session: str) -> Day:
        """Return the campus of a session, made on first use; the last KEPT are held."""
        with self._lock:
            if session not in self._days:
                season, seed = SEASONS[session], self.seed
                placed = moved(self.layout, seed, session)
                quads = assets.buildings(self.layout, seed, session, season)
                quads += assets.things(placed, seed, session, season)
                soil = terrain(self.layout, placed, self.route, seed, session, season)
                above = sky.panorama(stream(seed, "sky", session), season.light)
                self._days[session] = Day(season, mesh(quads), soil, above)
            self._days.move_to_end(session)
            while len(self._days) > KEPT:
                self._days.popitem(last=False)
            return self._days[session]

    def static(self, session: str, camera: Camera) -> Buffers:
        """Render the world of a session without the objects that come and go."""
        day = self.day(session)
        first, below = ground.view(camera, day.ground, day.season.light)
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
        paint(buffers, camera, day.mesh, gains(day.mesh, day.season.light, camera.position))
        return buffers

    def standing(self, session: str) -> list[int]:
        """Return the numbers of the objects that stand in a session."""
        return [k for k, item in enumerate(self.items) if session in item.sessions]

    def add(self, buffers: Buffers, camera: Camera, session: str, numbers: Sequence[int]) -> None:
        """Paint objects of World.items, in place, in the light of a session."""
        for k in numbers:
            quads = self.items[k].seen_from(camera)
            part = mesh(quads, [k] * len(quads))
            paint(buffers, camera, part, gains(part, SEASONS[session].light, camera.position))

    def populate(self, session: str, camera: Camera, static: Buffers) -> tuple[Buffers, dict[int, bool]]:
        """Paint the objects of a session into a copy of ``static``.

        An object is clearly seen if it owns LEAST_AREA of the image, LEAST_PIXELS pixels (both by its samples), and
        LEAST_SHARE of what it would own if nothing stood before it.

        Returns:
            The buffers, and of each object of which anything is to be seen whether it is clearly seen.
        """
        out = static.copy()
        self.add(out, camera, session, self.standing(session))
        least = SS * SS * max(LEAST_PIXELS, LEAST_AREA * self.width * self.height)
        owned = out.count(len(self.items))
        clear: dict[int, bool] = {}
        shape = static.inverse.shape
        alone = Buffers(
            np.zeros_like(static.color), np.zeros(shape, np.float32), np.zeros(shape, np.int32), [SKY], [-1]
        )
        for k in np.flatnonzero(owned).tolist():
            self.add(alone, camera, session, [k])
            clear[k] = owned[k] >= max(least, LEAST_SHARE * np.count_nonzero(alone.quad))
            alone.wipe()
        return out, clear

    def view(self, session: str, index: int) -> View:
        """Return one image; the same bytes in any process, thread and order.

        Args:
            session: one of SESSIONS.
            index: 0 <= index < the session's number of images.

        Raises:
            KeyError: there is no such session.
            IndexError: there is no such image.
        """
        if not 0 <= index < self.count[session]:
            raise IndexError(f"{session} image {index}: there are {self.count[session]}")
        camera = self.camera(session, index)
        buffers, clear = self.populate(session, camera, self.static(session, camera))
        things = (self.items[k] for k in clear)
        contacts = [[*item.at, 0.75 * item.radius] for item in things if item.radius]
        ground.darken(buffers, camera, np.array(contacts).reshape(-1, 3))
        seen = resolve(buffers)
        image = photograph(
            seen.color, seen.depth, SEASONS[session].light, stream(self.seed, "photograph", session, index)
        )
        items = np.array(list(clear), np.int64)
        place = camera.x, camera.y, camera.heading
        return View(
            image, seen.label, seen.depth, items, buffers.boxes(items), np.array(list(clear.values()), bool), place
        )

    def changes(self, view: View, against: str) -> NDArray[np.bool_]:
        """Tell which of the objects in a view do not stand in the session ``against``: bool [n]."""
        return np.array([against not in self.items[k].sessions for k in view.items], bool).reshape(-1)
