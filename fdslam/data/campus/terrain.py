"""The ground of a session: what it is made of, road markings, and the rain, snow, leaves and tracks on it."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus import ground as soil
from fdslam.data.campus.flora import SNOW
from fdslam.data.campus.ground import Ground, to_map
from fdslam.data.campus.layout import ROAD, Layout, Thing
from fdslam.data.campus.route import LENGTH, Route
from fdslam.data.campus.seasons import Season
from fdslam.data.campus.seeds import stream
from fdslam.data.campus.texture import Texture, noise, shift, to_bytes

_N, _SCALE = soil.PIXELS, soil.PIXELS / soil.SIDE  # pixels of the map, pixels per metre
_COARSE = _N // 4  # pixels: side of the maps of snow and rain, which have no sharp edges
Map = NDArray[np.uint8]


def _materials(plan: Layout, way: Route) -> Map:
    """Paint which share of the ground is paving, asphalt and grass [_N, _N, 3]."""
    weight = np.zeros((_N, _N, 3), np.uint8)
    weight[..., soil.GRASS] = 255
    for b in plan.buildings:
        cv2.polylines(weight, [to_map(b.feet)], True, (255, 0, 0), int(2.4 * _SCALE))
    cv2.polylines(weight, [to_map(way.points)], True, (255, 0, 0), int(3.4 * _SCALE))
    far = soil.SIDE / 2 + 6
    for wide, material in ((ROAD + 1.4, (255, 0, 0)), (ROAD, (0, 255, 0))):
        edge = to_map(np.array([[-far, plan.road + wide], [far, plan.road - wide]]))
        cv2.rectangle(weight, tuple(edge[0].tolist()), tuple(edge[1].tolist()), material, -1)
    return weight


def _bare(plan: Layout, way: Route, seed: int, grass: tuple[float, float, float], weight: Map) -> Map:
    """Paint the ground without weather [_N, _N, 3]."""
    tones = np.array([(176, 168, 156), (96, 96, 100), grass], np.float32)
    image = np.empty((_N, _N, 3), np.uint8)
    image[:] = tones[soil.GRASS]
    for m in (soil.PAVING, soil.ASPHALT):
        cv2.copyTo(np.broadcast_to(tones[m], (_N, _N, 3)).astype(np.uint8), weight[..., m], image)
    rng = stream(seed, "ground")
    small = cv2.cvtColor(to_bytes(128 * (1 + 0.16 * noise(rng, _COARSE, _COARSE, 50, 4))), cv2.COLOR_GRAY2RGB)
    patches = cv2.resize(small, (_N, _N), interpolation=cv2.INTER_LINEAR)
    image = np.asarray(cv2.multiply(image, patches, scale=1 / 128), np.uint8)
    _markings(image, plan, way)
    fixed = stream(seed, "stains")
    for x, y in to_map(way.at(fixed.uniform(0, LENGTH, 50)) + fixed.normal(0, 0.9, (50, 2))).tolist():
        cv2.circle(image, (x, y), 5, (128, 122, 114), -1, cv2.LINE_AA)
        cv2.circle(image, (x, y), 4, (156, 150, 140), 1, cv2.LINE_AA)
    return image


def _markings(image: Map, plan: Layout, way: Route) -> None:
    """Paint the path's kerb stones, the road's lines and the crossings."""
    along = np.arange(len(way.points)) * LENGTH / len(way.points)
    for side in (-1.7, 1.7):
        cv2.polylines(
            image, [to_map(way.beside(along, np.full(len(along), side)))], True, (138, 132, 124), 3, cv2.LINE_AA
        )

    def strip(x0: float, x1: float, y: float, width: float, color: tuple[int, int, int]) -> None:
        a, b = to_map(np.array([[x0, y + width / 2], [x1, y - width / 2]])).tolist()
        cv2.rectangle(image, (a[0], a[1]), (b[0], b[1]), color, -1)

    far = soil.SIDE / 2
    for side in (-1, 1):
        strip(-far, far, plan.road + side * ROAD, 0.22, (190, 186, 178))
    for x in np.arange(1 - far, far, 4.0):
        strip(x, x + 2, plan.road, 0.14, (228, 228, 222))
    crossing = np.flatnonzero(np.diff(np.sign(way.points[:, 1] - plan.road)))
    for x in way.points[crossing, 0]:
        strip(x - 2.6, x + 2.6, plan.road, 2 * ROAD - 0.4, (96, 96, 100))
        for y in np.arange(-ROAD + 0.4, ROAD - 0.2, 0.9):
            strip(x - 2.2, x + 2.2, plan.road + y + 0.2, 0.5, (232, 232, 226))


def _lay(image: Map, weight: Map, cover: NDArray[np.float32], color: NDArray[np.float32], keep: float) -> None:
    """Lay something over the ground, in place, and smooth its detail away under it.

    Args:
        image: colours.
        weight: shares of the materials, which decide how much of their detail shows.
        cover: [_COARSE, _COARSE] 0..1, how much of it lies where.
        color: [_COARSE, _COARSE, 3] its own colour.
        keep: share of the ground's own colour that shows through all the same.
    """
    alpha = cv2.resize(to_bytes(255 * cover), (_N, _N), interpolation=cv2.INTER_CUBIC)
    over = cv2.resize(to_bytes(color), (_N, _N), interpolation=cv2.INTER_LINEAR)
    share = cv2.cvtColor(alpha, cv2.COLOR_GRAY2RGB)
    under = cv2.multiply(
        image, 255 - cv2.multiply(share, np.full_like(share, 255), scale=(1 - keep) / 255), scale=1 / 255
    )
    image[:] = cv2.add(under, cv2.multiply(over, share, scale=(1 - keep) / 255))
    weight[:] = cv2.multiply(
        weight, 255 - cv2.multiply(share, np.full_like(share, 255), scale=0.85 / 255), scale=1 / 255
    )


def _rain(image: Map, weight: Map, seed: int, session: str, day: Season) -> None:
    """Wet the ground: darker all over, and puddles that show the sky."""
    image[:] = cv2.convertScaleAbs(image, alpha=1 - 0.22 * day.wet)
    hard = cv2.resize(weight[..., : soil.GRASS].sum(2, dtype=np.uint16).astype(np.float32) / 255, (_COARSE, _COARSE))
    # Water stands where the ground is low, which is the same in every session.
    level = noise(stream(seed, "hollows"), _COARSE, _COARSE, 60, 3)
    cover = np.clip((level + 0.8 * day.wet - 0.72) * 5, 0, 1) * np.clip(hard, 0, 1)
    sky = 0.55 * np.array(day.light.zenith, np.float32) + 0.3 * np.array(day.light.horizon, np.float32)
    _lay(image, weight, cover.astype(np.float32), np.broadcast_to(sky, (*cover.shape, 3)), 0.45)


def _snow(image: Map, weight: Map, way: Route, seed: int, session: str, day: Season) -> None:
    """Cover the ground with snow: thin where people walk and cars drive."""
    rng = stream(seed, "snow", session)
    share = cv2.resize(weight, (_COARSE, _COARSE), interpolation=cv2.INTER_AREA).astype(np.float32) / 255
    trodden = np.zeros((_COARSE, _COARSE), np.float32)
    cv2.polylines(trodden, [to_map(way.points) // 4], True, (1.0,), round(1.9 * _SCALE / 4))
    trodden = np.asarray(cv2.GaussianBlur(trodden, (0, 0), 0.5 * _SCALE / 4), np.float32)
    deep = share @ np.array([1.0, 0.62, 1.5], np.float32) - 0.42 * trodden
    cover = np.clip((deep * day.snow + 0.42 * noise(rng, _COARSE, _COARSE, 90, 4) - 0.38) * 3, 0, 1)
    tone = 1 + 0.035 * noise(rng, _COARSE, _COARSE, 50, 5)
    _lay(image, weight, cover.astype(np.float32), tone[..., None] * np.array(SNOW, np.float32), 0.06)


def _tracks(image: Map, way: Route, seed: int, session: str, day: Season) -> None:
    """Leave footprints and the tracks of wheels along the path."""
    rng = stream(seed, "tracks", session)
    tone = (178, 186, 200) if day.snow else (118, 106, 90)

    def course() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        start, length = rng.uniform(0, LENGTH), rng.uniform(50, LENGTH)
        s = start + np.arange(0, length, 0.66)
        phase = rng.uniform(0, 2 * np.pi, 2)
        return s, rng.normal(0, 0.7) + 0.6 * np.sin(s / 9 + phase[0]) + 0.5 * np.sin(s / 23 + phase[1])

    for _ in range(day.wheels):
        s, side = course()
        for apart in (-0.28, 0.28) if rng.random() < 0.5 else (0.0,):
            cv2.polylines(image, [to_map(way.beside(s, side + apart))], False, tone, 1, cv2.LINE_AA)
    for _ in range(day.walkers):
        s, side = course()
        foot = way.beside(s, side + 0.13 * (-1) ** np.arange(len(s)))
        turned = -np.degrees(way.heading(s))
        for (x, y), angle in zip(to_map(foot).tolist(), turned.tolist(), strict=True):
            cv2.ellipse(image, (x, y), (3, 1), angle, 0, 360, tone, -1)


def _litter(image: Map, way: Route, seed: int, session: str, day: Season) -> None:
    """Strew fallen leaves along the path."""
    rng = stream(seed, "litter", session)
    fallen = int(day.litter * 20 * LENGTH)
    where = way.at(rng.uniform(0, LENGTH, fallen)) + rng.normal(0, 3.5, (fallen, 2))
    for k, (x, y) in enumerate(to_map(where).tolist()):
        cv2.circle(image, (x, y), 1, shift(day.leaves[k % 4], 0.1), -1)


def terrain(plan: Layout, things: Sequence[Thing], way: Route, seed: int, session: str, day: Season) -> Ground:
    """Return the ground of a session.

    Args:
        plan: the campus.
        things: what stands on it that day and casts shadows.
        way: the path.
        seed: the world's.
        session: whose weather and tracks.
        day: what they are like.
    """
    weight = _materials(plan, way)
    color = _bare(plan, way, seed, day.grass, weight)
    if day.wet:
        _rain(color, weight, seed, session, day)
    if day.snow:
        _snow(color, weight, way, seed, session, day)
    _tracks(color, way, seed, session, day)
    _litter(color, way, seed, session, day)
    casters = [(b.feet, b.height) for b in plan.buildings]
    disc = np.stack([np.cos(np.linspace(0, 6, 10)), np.sin(np.linspace(0, 6, 10))], axis=1)
    casters += [(t.at + disc * 0.26 * t.size * day.density, t.size * 0.8) for t in things if t.kind == "tree"]
    casters += [(t.at + disc * 1.0, 1.0) for t in things if t.kind == "car"]
    shade = soil.shadows(casters, day.light)
    detail = soil.details(stream(seed, "detail"))
    return Ground(Texture(lambda: color), Texture(lambda: weight), Texture(lambda: shade), detail)
