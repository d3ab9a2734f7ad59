"""From the layout to the quads of a session: buildings, plants and the things between them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fdslam.data.campus import props
from fdslam.data.campus.facade import facade, gable, roof
from fdslam.data.campus.flora import bark, bush, crown, hedge, limbs
from fdslam.data.campus.layout import Building, Layout, Thing
from fdslam.data.campus.passage import entrance, locker, passage
from fdslam.data.campus.scene import BUILDING, VEGETATION, Quad, box, crossed, turn, wall
from fdslam.data.campus.seasons import Season
from fdslam.data.campus.seeds import stream
from fdslam.data.campus.texture import Color, Texture

COLUMN = 4.0  # metres: widest piece of a facade with one resolution
_TILES: tuple[Color, ...] = ((150, 78, 58), (104, 66, 58), (88, 92, 100), (126, 110, 96))


def _roof(b: Building, seed: int, index: int, snow: float, eaves: float = 0.5) -> list[Quad]:
    """Return a gabled roof with its ridge along the building."""
    rng = stream(seed, "roof", index)
    color = _TILES[rng.integers(len(_TILES))]
    tiles, triangle = (
        Texture(lambda: roof(stream(seed, "tiles", index), color, snow)),
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


def _face(b: Building, seed: int, index: int, face: int, session: str, day: Season) -> Texture:
    length, names = b.size[face % 2], (index, face)
    return Texture(
        lambda: facade(
            stream(seed, "facade", *names), stream(seed, "day", session, *names), b.style, length, b.storeys, day
        )
    )


def buildings(plan: Layout, seed: int, session: str, day: Season) -> list[Quad]:
    """Return the walls and roofs, and the passage through the first building.

    What is built is the same in every session; blinds, lamps, damp and snow are not.
    """
    quads: list[Quad] = []
    for i, b in enumerate(plan.buildings):
        feet = b.feet
        for face in range(4):
            texture = _face(b, seed, i, face, session, day)
            if i == 0 and face % 2:
                quads += entrance(plan.passage, b, face, texture)
            else:
                quads += wall(feet[face], feet[(face + 1) % 4], 0, b.height, texture, BUILDING, COLUMN)
        if b.gabled:
            quads += _roof(b, seed, i, day.snow)
    return quads + passage(plan.passage, seed, session)


def _tree(t: Thing, crowns: list[Texture], trunk: Texture) -> list[Quad]:
    """Return a trunk and a crown of crossed quads; limbs start from within the trunk."""
    spread = 0.72 * t.size
    quads = crossed(t.at, spread, 0.3 * t.size, t.size, t.angle, crowns[t.look], VEGETATION, 3)
    return [*crossed(t.at, 0.06 * t.size, 0, 0.55 * t.size, t.angle, trunk, VEGETATION, 2), *quads]


def _sign(seed: int, number: int) -> Texture:
    return Texture(lambda: props.sign_face(stream(seed, "sign", number)))


def things(placed: Sequence[Thing], seed: int, session: str, day: Season) -> list[Quad]:
    """Return what stands on the ground, in leaf or bare, and under snow, as it is in a session."""
    snow = day.snow

    def leafy(k: int) -> Texture:
        boughs = limbs(stream(seed, "limbs", k))
        return Texture(lambda: crown(boughs, stream(seed, "crown", session, k), day.leaves[k], day.density, snow))

    def dense(k: int) -> Texture:
        return Texture(lambda: bush(stream(seed, "bush", session, k), day.leaves[k], snow))

    def clipped(k: int) -> Texture:
        return Texture(lambda: hedge(stream(seed, "hedge", session, k), day.leaves[k], snow))

    crowns, bushes, hedges = ([make(k) for k in range(4)] for make in (leafy, dense, clipped))
    trunk = Texture(lambda: bark(stream(seed, "bark")))
    cars = [props.car_textures(c, snow) for c in props.PAINTS]
    white = props.WHITE if snow else None
    quads: list[Quad] = []
    for t in placed:
        if t.kind == "tree":
            quads += _tree(t, crowns, trunk)
        elif t.kind == "bush":
            quads += crossed(t.at, 1.7 * t.size, -0.3, 1.2 * t.size, t.angle, bushes[t.look], VEGETATION, 3)
        elif t.kind == "hedge":
            leaf = hedges[t.look]
            quads += box(t.at, (t.size, 0.7), t.angle, 0, 1.0, leaf, white or leaf, VEGETATION)
        elif t.kind == "lamp":
            quads += props.lamp(t.at, t.angle, t.size)
        elif t.kind == "sign":
            quads += props.sign(t.at, t.angle, _sign(seed, t.number))
        elif t.kind == "bench":
            quads += props.bench(t.at, t.angle, white)
        elif t.kind == "bicycle":
            quads += props.bicycle(t.at, t.angle, props.BICYCLES[t.look])
        elif t.kind == "bin":
            quads += props.bin_(t.at, t.angle, props.GREEN, white)
        elif t.kind == "bollard":
            quads += props.bollard(t.at)
        elif t.kind == "locker":
            quads += locker(t.at, t.angle, t.size, t.look)
        else:
            quads += props.car(t.at, t.angle, cars[t.look])
    return quads
