"""From the layout to the quads and the ground of a session."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus import ground as soil
from fdslam.data.campus import props
from fdslam.data.campus.facade import facade, gable, roof
from fdslam.data.campus.flora import Season, bark, crown, hedge
from fdslam.data.campus.ground import Ground, to_map
from fdslam.data.campus.layout import ROAD, Building, Layout, Thing
from fdslam.data.campus.light import Light
from fdslam.data.campus.route import LENGTH, Route
from fdslam.data.campus.scene import BUILDING, VEGETATION, Quad, box, crossed, turn, wall
from fdslam.data.campus.seeds import stream
from fdslam.data.campus.texture import Color, Texture, noise, shift, to_bytes

COLUMN = 4.0  # metres: widest piece of a facade with one resolution
_TILES: tuple[Color, ...] = ((150, 78, 58), (104, 66, 58), (88, 92, 100), (126, 110, 96))


def _roof(b: Building, seed: int, index: int, eaves: float = 0.5) -> list[Quad]:
    """Return a gabled roof with its ridge along the building."""
    rng = stream(seed, "roof", index)
    color = _TILES[rng.integers(len(_TILES))]
    tiles, triangle = (
        Texture(lambda: roof(stream(seed, "tiles", index), color)),
        Texture(lambda: gable(stream(seed, "gable", index), b.style)),
    )
    rise = 0.42 * b.size[1]
    axes = turn(b.angle)
    along, across = axes[:, 0], axes[:, 1]
    quads = []
    for side in (-1, 1):
        # Right is along the building as seen from that side.
        right = along * (b.size[0] + 2 * eaves) * -side
        low = b.center + across * side * (b.size[1] / 2 + eaves) - right / 2
        top = np.array([*(b.center - right / 2), b.height + rise])
        drop = rise * eaves / (b.size[1] / 2)
        quads.append(
            Quad(top, np.array([*right, 0.0]), np.array([*low, b.height - drop]) - top, tiles, BUILDING, two_sided=True)
        )
    feet = b.feet
    for i in (1, 3):
        quads += wall(feet[i], feet[(i + 1) % 4], b.height, b.height + rise, triangle, BUILDING)
    return quads


def buildings(plan: Layout, seed: int) -> list[Quad]:
    """Return the walls and roofs, the same in every session."""
    quads: list[Quad] = []
    for i, b in enumerate(plan.buildings):
        feet = b.feet
        for face in range(4):
            texture = Texture(
                lambda b=b, i=i, face=face: facade(  # type: ignore[misc]
                    stream(seed, "facade", i, face), b.style, b.size[face % 2], b.storeys
                )
            )
            quads += wall(feet[face], feet[(face + 1) % 4], 0, b.height, texture, BUILDING, COLUMN)
        if b.gabled:
            quads += _roof(b, seed, i)
    return quads


def _tree(t: Thing, crowns: list[Texture], trunk: Texture) -> list[Quad]:
    """Return a trunk and a crown of crossed quads."""
    spread = 0.72 * t.size
    quads = crossed(t.at, spread, 0.3 * t.size, t.size, t.angle, crowns[t.look], VEGETATION, 3)
    return [*crossed(t.at, 0.06 * t.size, 0, 0.55 * t.size, t.angle, trunk, VEGETATION, 2), *quads]


def things(plan: Layout, seed: int, session: str, season: Season) -> list[Quad]:
    """Return what stands on the ground, its leaves as they are in a session."""

    def leaves(name: str, k: int, density: float) -> Texture:
        return Texture(lambda: crown(stream(seed, name, session, k), season.leaves[k], density))

    crowns = [leaves("crown", k, season.density) for k in range(4)]
    bushes = [leaves("bush", k, 1.0) for k in range(4)]
    hedges = [Texture(lambda k=k: hedge(stream(seed, "hedge", session, k), season.leaves[k])) for k in range(4)]  # type: ignore[misc]
    trunk = Texture(lambda: bark(stream(seed, "bark")))
    cars = [props.car_textures(c) for c in props.PAINTS]
    quads: list[Quad] = []
    for i, t in enumerate(plan.things):
        if t.kind == "tree":
            quads += _tree(t, crowns, trunk)
        elif t.kind == "bush":
            quads += crossed(t.at, 1.7 * t.size, -0.3, 1.2 * t.size, t.angle, bushes[t.look], VEGETATION, 3)
        elif t.kind == "hedge":
            leaf = hedges[t.look]
            quads += box(t.at, (t.size, 0.7), t.angle, 0, 1.0, leaf, leaf, VEGETATION)
        elif t.kind == "lamp":
            quads += props.lamp(t.at, t.angle, t.size)
        elif t.kind == "sign":
            quads += props.sign(t.at, t.angle, Texture(lambda i=i: props.sign_face(stream(seed, "sign", i))))  # type: ignore[misc]
        elif t.kind == "bench":
            quads += props.bench(t.at, t.angle)
        elif t.kind == "bicycle":
            quads += props.bicycle(t.at, t.angle, props.BICYCLES[t.look])
        elif t.kind == "bin":
            quads += props.bin_(t.at, t.angle, props.GREEN)
        elif t.kind == "bollard":
            quads += props.bollard(t.at)
        else:
            quads += props.car(t.at, t.angle, cars[t.look])
    return quads


def _colors(plan: Layout, way: Route, seed: int, session: str, season: Season) -> list[NDArray[np.uint8]]:
    """Paint the ground's colours and materials, [PIXELS, PIXELS, 3] each."""
    n = soil.PIXELS
    rng = stream(seed, "ground", session)
    weight = np.zeros((n, n, 3), np.uint8)
    weight[..., soil.GRASS] = 255
    scale = n / soil.SIDE
    line = [to_map(way.points)]
    for b in plan.buildings:
        cv2.polylines(weight, [to_map(b.feet)], True, (255, 0, 0), int(2.4 * scale))
    cv2.polylines(weight, line, True, (255, 0, 0), int(3.4 * scale))
    edge = to_map(np.array([[-70, plan.road + ROAD + 1.4], [70, plan.road - ROAD - 1.4]]))
    cv2.rectangle(weight, tuple(edge[0].tolist()), tuple(edge[1].tolist()), (255, 0, 0), -1)
    edge = to_map(np.array([[-70, plan.road + ROAD], [70, plan.road - ROAD]]))
    cv2.rectangle(weight, tuple(edge[0].tolist()), tuple(edge[1].tolist()), (0, 255, 0), -1)
    tones = np.array([(176, 168, 156), (96, 96, 100), season.grass], np.float32)
    image = np.empty((n, n, 3), np.uint8)
    image[:] = tones[soil.GRASS]
    for m in (soil.PAVING, soil.ASPHALT):
        cv2.copyTo(np.broadcast_to(tones[m], (n, n, 3)).astype(np.uint8), weight[..., m], image)
    small = cv2.cvtColor(to_bytes(128 * (1 + 0.16 * noise(rng, n // 4, n // 4, 40, 4))), cv2.COLOR_GRAY2RGB)
    patches = cv2.resize(small, (n, n), interpolation=cv2.INTER_LINEAR)
    image = np.asarray(cv2.multiply(image, patches, scale=1 / 128), np.uint8)
    _markings(image, plan, way, scale)
    fixed = stream(seed, "stains")
    for x, y in to_map(way.at(fixed.uniform(0, LENGTH, 40)) + fixed.normal(0, 0.9, (40, 2))).tolist():
        cv2.circle(image, (x, y), 5, (128, 122, 114), -1, cv2.LINE_AA)
        cv2.circle(image, (x, y), 4, (156, 150, 140), 1, cv2.LINE_AA)
    fallen = int(season.litter * 20 * LENGTH)
    where = way.at(rng.uniform(0, LENGTH, fallen)) + rng.normal(0, 3.5, (fallen, 2))
    for k, (x, y) in enumerate(to_map(where).tolist()):
        cv2.circle(image, (x, y), 1, shift(season.leaves[k % 4], 0.1), -1)
    return [image, weight]


def _markings(image: NDArray[np.uint8], plan: Layout, way: Route, scale: float) -> None:
    """Paint the path's kerb stones, the road's lines and the crossings."""
    for offset in (-1.7, 1.7):
        heading = way.heading(np.arange(len(way.points)) * LENGTH / len(way.points))
        edge = way.points + offset * np.stack([-np.sin(heading), np.cos(heading)], axis=1)
        cv2.polylines(image, [to_map(edge)], True, (138, 132, 124), 3, cv2.LINE_AA)

    def strip(x0: float, x1: float, y: float, width: float, color: tuple[int, int, int]) -> None:
        a, b = to_map(np.array([[x0, y + width / 2], [x1, y - width / 2]])).tolist()
        cv2.rectangle(image, (a[0], a[1]), (b[0], b[1]), color, -1)

    for side in (-1, 1):
        strip(-64, 64, plan.road + side * ROAD, 0.22, (190, 186, 178))
    for x in np.arange(-63, 63, 4.0):
        strip(x, x + 2, plan.road, 0.14, (228, 228, 222))
    crossing = np.flatnonzero(np.diff(np.sign(way.points[:, 1] - plan.road)))
    for x in way.points[crossing, 0]:
        strip(x - 2.6, x + 2.6, plan.road, 2 * ROAD - 0.4, (96, 96, 100))
        for y in np.arange(-ROAD + 0.4, ROAD - 0.2, 0.9):
            strip(x - 2.2, x + 2.2, plan.road + y + 0.2, 0.5, (232, 232, 226))


def ground(plan: Layout, way: Route, seed: int, session: str, season: Season, light: Light) -> Ground:
    """Return the ground of a session."""
    color, weight = _colors(plan, way, seed, session, season)
    casters = [(b.feet, b.height) for b in plan.buildings]
    disc = np.stack([np.cos(np.linspace(0, 6, 10)), np.sin(np.linspace(0, 6, 10))], axis=1)
    casters += [(t.at + disc * 0.26 * t.size * season.density, t.size * 0.8) for t in plan.things if t.kind == "tree"]
    casters += [(t.at + disc * 1.0, 1.0) for t in plan.things if t.kind == "car"]
    shade = soil.shadows(casters, light)
    return Ground(
        Texture(lambda: color), Texture(lambda: weight), Texture(lambda: shade), soil.details(stream(seed, "detail"))
    )
