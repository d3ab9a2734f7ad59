"""Facades: masonry, storeys of windows, doors, and what years and the day's weather leave on a wall."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus.flora import SNOW
from fdslam.data.campus.seasons import Season
from fdslam.data.campus.texture import Color, noise, shift, to_bytes

DENSITY = 32  # texture pixels per metre
MOVED = 0.5  # share of the windows behind which something has changed from session to session
MATERIALS = ("brick", "plaster", "panel", "clinker", "timber", "stone")
_WALLS: dict[str, tuple[Color, ...]] = {
    "brick": ((168, 92, 72), (140, 74, 60), (186, 122, 92), (196, 168, 132)),
    "plaster": ((226, 212, 184), (214, 186, 140), (188, 204, 208), (222, 196, 190), (200, 208, 178)),
    "panel": ((176, 178, 176), (150, 160, 168), (196, 190, 178)),
    "clinker": ((112, 84, 78), (92, 96, 104), (150, 134, 112)),
    "timber": ((158, 116, 78), (108, 82, 62), (128, 138, 126)),
    "stone": ((190, 180, 156), (168, 158, 142), (204, 192, 170)),
}
_FRAMES: tuple[Color, ...] = ((240, 240, 236), (70, 72, 76), (120, 84, 56), (56, 84, 72), (150, 50, 44))


@dataclass(frozen=True)
class Style:
    """What the faces of one building share; lengths in metres."""

    material: str
    wall: Color
    trim: Color
    frame: Color
    bay: float  # from window to window
    storey: float  # from floor to floor
    window: tuple[float, float]  # width and height
    panes: tuple[int, int]  # columns and rows
    arched: bool
    banded: bool  # a course of trim at every floor


def style(rng: np.random.Generator) -> Style:
    """Draw a building's style."""
    material = MATERIALS[rng.integers(len(MATERIALS))]
    walls = _WALLS[material]
    wall = shift(walls[rng.integers(len(walls))], rng.uniform(-0.1, 0.1))
    bay = rng.uniform(2.1, 4.2)
    storey = rng.uniform(3.0, 3.8)
    window = (bay * rng.uniform(0.36, 0.74), storey * rng.uniform(0.42, 0.62))
    panes = (int(rng.integers(1, 4)), int(rng.integers(1, 4)))
    trim = shift(wall, rng.choice([-0.35, 0.25, 0.4]))
    frame = _FRAMES[rng.integers(len(_FRAMES))]
    return Style(material, wall, trim, frame, bay, storey, window, panes, rng.random() < 0.25, rng.random() < 0.6)


def masonry(rng: np.random.Generator, kind: str, color: Color, height: int, width: int) -> NDArray[np.float32]:
    """Return a wall's surface [height, width, 3] in 0..255, DENSITY pixels per metre."""
    tone = 1 + 0.06 * noise(rng, height, width, 6, 4)
    tone *= 1 + rng.normal(0, 0.025, (height, width)).astype(np.float32)
    course = {"brick": (3, 8), "clinker": (2, 11), "stone": (14, 26), "panel": (50, 77), "timber": (0, 5)}.get(kind)
    if kind == "timber":
        planks = rng.normal(1, 0.1, width // 5 + 1).repeat(5)[:width]
        planks[::5] *= 0.7
        tone *= planks.astype(np.float32)
    elif course is not None:
        h, w = course
        spread = {"brick": 0.13, "clinker": 0.15, "stone": 0.09, "panel": 0.03}[kind]
        for row, y in enumerate(range(0, height, h)):
            bricks = rng.normal(1, spread, width // w + 2).repeat(w)
            joint = (np.arange(len(bricks)) % w == 0) & (h > 2)
            bricks = np.where(joint, 0.78 if kind != "brick" else 1.25, bricks)
            offset = (w // 2) * (row % 2) if kind != "panel" else 0
            tone[y : y + h] *= bricks[offset : offset + width].astype(np.float32)
            if h > 2:
                tone[y : y + 1] *= 0.8 if kind != "brick" else 1.12
    return tone[..., None] * np.array(color, np.float32)


def _behind(rng: np.random.Generator, image: NDArray[np.float32], box: tuple[int, int, int, int], day: Season) -> None:
    """Draw what is seen behind the glass."""
    x0, y0, x1, y1 = box
    h, w = y1 - y0, x1 - x0
    deep = np.array((46, 58, 70), np.float32) * rng.uniform(0.6, 1.5)
    if rng.random() < day.lamps:
        deep = np.array((232, 196, 128), np.float32) * rng.uniform(0.5, 0.9)
    glass = deep * np.linspace(1.7, 0.7, h, dtype=np.float32)[:, None, None] + np.zeros((h, w, 1), np.float32)
    image[y0:y1, x0:x1] = np.minimum(glass, 255)
    pick = rng.random()
    if pick < day.shut:
        drawn = y0 + int(h * rng.uniform(0.2, 1.0))
        image[y0:drawn, x0:x1] = np.array((214, 208, 192), np.float32) * rng.uniform(0.7, 1.1)
        image[y0:drawn:3, x0:x1] *= 0.82
    elif pick < day.shut + 0.2:  # curtains
        tint = rng.uniform(110, 235, 3).astype(np.float32)
        part = max(1, int(w * rng.uniform(0.15, 0.4)))
        folds = (1 + 0.15 * np.sin(np.arange(part) * 1.9)).astype(np.float32)[None, :, None]
        image[y0:y1, x0 : x0 + part] = tint * folds
        image[y0:y1, x1 - part : x1] = tint * folds
    elif pick < day.shut + 0.33:  # things on the window sill
        for _ in range(int(rng.integers(1, 4))):
            x, r = int(rng.integers(x0, x1)), int(rng.integers(2, 6))
            cv2.circle(image, (x, y1 - r), r, tuple(rng.uniform(20, 230, 3)), -1)
    elif pick < day.shut + 0.48:  # a bright reflection
        x = int(rng.integers(x0, x1))
        cv2.line(image, (x, y0), (x - w // 2, y1 - 1), tuple(float(v) for v in deep * 3), max(2, w // 5))


def _window(
    rng: np.random.Generator, image: NDArray[np.float32], box: tuple[int, int, int, int], st: Style, day: Season
) -> None:
    """Draw one window with its frame, sill, panes, and what is seen behind the glass."""
    x0, y0, x1, y1 = box
    h, w = y1 - y0, x1 - x0
    lip = max(1, round(0.07 * DENSITY))
    cv2.rectangle(image, (x0 - 2 * lip, y0 - 2 * lip), (x1 + 2 * lip, y1 + 2 * lip), st.trim, -1)
    if st.arched:
        cv2.ellipse(image, ((x0 + x1) // 2, y0), (w // 2 + 2 * lip, w // 3), 0, 180, 360, st.trim, -1)
    cv2.rectangle(image, (x0 - lip, y0 - lip), (x1 + lip - 1, y1 + lip - 1), st.frame, -1)
    _behind(rng, image, box, day)
    for i in range(1, st.panes[0]):
        x = x0 + i * w // st.panes[0]
        cv2.line(image, (x, y0), (x, y1 - 1), st.frame, max(1, lip // 2))
    for j in range(1, st.panes[1]):
        y = y0 + j * h // st.panes[1]
        cv2.line(image, (x0, y), (x1 - 1, y), st.frame, max(1, lip // 2))
    sill = SNOW if rng.random() < 1.2 * day.snow else shift(st.trim, 0.2)
    cv2.rectangle(image, (x0 - 2 * lip, y1 + lip), (x1 + 2 * lip, y1 + 2 * lip), sill, -1)
    image[y1 + 2 * lip + 1 : y1 + 3 * lip + 2, x0 - 2 * lip : x1 + 2 * lip] *= 0.7


def _door(rng: np.random.Generator, image: NDArray[np.float32], x: int, st: Style) -> None:
    """Draw a door with its surround, lights and steps at column ``x``."""
    foot = image.shape[0]
    w, h = int(rng.uniform(1.1, 2.2) * DENSITY), int(rng.uniform(2.2, 2.7) * DENSITY)
    leaf: Color = tuple(rng.uniform(30, 150, 3))
    cv2.rectangle(image, (x - 7, foot - h - 16), (x + w + 7, foot), st.trim, -1)
    cv2.rectangle(image, (x - 10, foot - h - 20), (x + w + 10, foot - h - 12), shift(st.trim, 0.3), -1)
    cv2.rectangle(image, (x, foot - h), (x + w, foot), leaf, -1)
    cv2.rectangle(image, (x + 4, foot - h + 4), (x + w - 4, foot - h + h // 5), (52, 64, 78), -1)
    for k in range(2):
        a, b = x + 4 + k * w // 2, x + (k + 1) * w // 2 - 3
        cv2.rectangle(image, (a, foot - h + h // 4), (b, foot - h // 2), (70, 84, 98), -1)
        cv2.rectangle(image, (a, foot - h // 2 + 6), (b, foot - 12), shift(leaf, -0.3), 2)
    cv2.line(image, (x + w // 2, foot - h), (x + w // 2, foot), shift(leaf, -0.5), 1)
    cv2.circle(image, (x + w // 2 + 5, foot - h // 2 + 4), 2, (220, 210, 150), -1)
    cv2.rectangle(image, (x - 10, foot - 5), (x + w + 10, foot), (150, 148, 142), -1)
    text = f"{int(rng.integers(1, 99))}{'ABCDEFGH'[rng.integers(8)]}"
    plaque = np.full((22, 46, 3), np.rint(shift(leaf, -0.3)), np.uint8)
    cv2.putText(plaque, text, (4, 17), cv2.FONT_HERSHEY_DUPLEX, 0.6, (250, 250, 250), 1)
    top, left = max(0, foot - h - 46), max(0, min(x, image.shape[1] - 46))
    image[top : top + 22, left : left + 46] = plaque[:, : image.shape[1] - left]


def _weather(rng: np.random.Generator, image: NDArray[np.float32], st: Style) -> None:
    """Add pipes, boxes, vents, plaques, scrawls and stains."""
    height, width = image.shape[:2]
    for _ in range(int(rng.integers(1, 3))):
        x = int(rng.integers(2, max(3, width - 6)))
        image[:, x : x + 4] = np.array(shift(st.trim, -0.2), np.float32) * np.array([1.2, 1.1, 0.9, 0.6])[None, :, None]
        image[:: int(rng.integers(40, 70)), x - 1 : x + 5] *= 0.5
    for _ in range(int(width / DENSITY / 2.5)):
        x, y = int(rng.integers(0, width)), height - int(rng.uniform(0.4, 3.0) * DENSITY)
        w, h = (int(v) for v in rng.uniform(0.15, 0.8, 2) * DENSITY)
        color: Color = tuple(rng.uniform(20, 240, 3))
        kind = rng.integers(4)
        if kind == 0:  # a vent
            cv2.rectangle(image, (x, y), (x + w, y + h), shift(st.wall, -0.5), -1)
            for k in range(y, y + h, 3):
                cv2.line(image, (x, k), (x + w, k), shift(st.wall, 0.2), 1)
        elif kind == 1:  # a plaque
            cv2.rectangle(image, (x, y), (x + w, y + h), color, -1)
            cv2.rectangle(image, (x + 2, y + 2), (x + w - 2, y + h - 2), shift(color, -0.6), 1)
            cv2.line(image, (x + 4, y + h // 2), (x + w - 4, y + h // 2), (245, 245, 245), 2)
        elif kind == 2:  # a scrawl
            points = np.cumsum(rng.normal(0, 0.22 * DENSITY, (9, 2)), axis=0) + np.array([x, y])
            cv2.polylines(image, [points.astype(np.int32)], False, color, 2, cv2.LINE_AA)
        else:  # a meter box
            cv2.rectangle(image, (x, y), (x + w, y + h), shift(st.trim, -0.1), -1)
            cv2.rectangle(image, (x, y), (x + w, y + h), shift(st.trim, -0.6), 1)
    stain = np.clip(noise(rng, height, width, 9, 3), 0, 1)
    image *= (1 - 0.25 * stain * np.linspace(0.2, 1, height, dtype=np.float32)[:, None])[..., None]


def _soil(rng: np.random.Generator, image: NDArray[np.float32], day: Season) -> None:
    """Add what a session's weather does to a wall: damp from below, driven snow."""
    height, width = image.shape[:2]
    up = np.linspace(1, 0, height, dtype=np.float32)[:, None] ** 0.5
    damp = np.clip(noise(rng, height, width, 7, 3) + 0.9 - 1.6 * up, 0, 1)
    image *= (1 - 0.3 * day.wet * damp)[..., None]
    rime = np.clip(noise(rng, height, width, 12, 4) - 0.25, 0, 1)[..., None] * np.float32(0.9 * day.snow)
    image *= 1 - rime
    image += rime * np.array(SNOW, np.float32)


def facade(
    rng: np.random.Generator, today: np.random.Generator, st: Style, width: float, storeys: int, day: Season
) -> NDArray[np.uint8]:
    """Paint a facade.

    Args:
        rng: where this face differs from its building's others.
        today: where it differs from other sessions.
        st: the building's style.
        width: metres.
        storeys: floors; the facade is ``storeys`` × ``st.storey`` metres high.
        day: of the session: blinds, lamps, damp and snow.

    Returns:
        [h, w, 3] RGB, DENSITY pixels per metre.
    """
    w, h = round(width * DENSITY), round(storeys * st.storey * DENSITY)
    image = np.ascontiguousarray(masonry(rng, st.material, st.wall, h, w))
    floor = st.storey * DENSITY
    plinth = int(rng.uniform(0.3, 0.9) * DENSITY)
    image[h - plinth :] = masonry(rng, "stone", shift(st.trim, -0.25), plinth, w)
    for k in range(storeys if st.banded else 0):
        y = int(k * floor)
        image[y : y + 6] = np.array(st.trim, np.float32)
        image[y + 6 : y + 8] *= 0.65
    image[:9] = np.array(shift(st.trim, 0.1), np.float32)
    image[9:12] *= 0.6
    bays = max(1, int((width - 0.6) / st.bay))
    gap = w / bays
    doors = set(rng.choice(bays, size=min(bays, int(rng.integers(1, 3))), replace=False).tolist())
    ww, wh = (int(v * DENSITY) for v in st.window)
    for k in range(storeys):
        top = int((k + 0.22) * floor)
        for bay in range(bays):
            x = int((bay + 0.5) * gap - ww / 2)
            if k == storeys - 1 and bay in doors:
                _door(rng, image, x, st)
            elif rng.random() < 0.95:
                fixed, new = (np.random.default_rng(int(r.integers(2**32))) for r in (rng, today))
                inside = new if today.random() < MOVED else fixed
                _window(inside, image, (x, top, x + ww, min(top + wh, h - 8)), st, day)
    _weather(rng, image, st)
    _soil(today, image, day)
    image *= np.linspace(1.06, 0.92, h, dtype=np.float32)[:, None, None]
    return to_bytes(image)


def roof(rng: np.random.Generator, color: Color, snow: float) -> NDArray[np.uint8]:
    """Paint roof tiles [192, 384, 3] with snow on that share of them."""
    tone = 1 + 0.1 * noise(rng, 192, 384, 8, 3)
    for row, y in enumerate(range(0, 192, 8)):
        tiles = rng.normal(1, 0.1, 384 // 10 + 2).repeat(10)
        tone[y : y + 8] *= tiles[5 * (row % 2) :][:384].astype(np.float32)
        tone[y + 7] *= 0.6
    image = tone[..., None] * np.array(color, np.float32)
    cover = np.clip((noise(rng, 192, 384, 7, 4) * 0.7 + 2.4 * snow - 1.2) * 2.5, 0, 1)[..., None]
    return to_bytes(image * (1 - cover) + cover * np.array(SNOW, np.float32) * (0.94 + 0.06 * tone[..., None]))


def gable(rng: np.random.Generator, st: Style) -> NDArray[np.uint8]:
    """Paint the triangle under a roof [128, 256, 4], cut out of its rectangle."""
    image = np.zeros((128, 256, 4), np.uint8)
    image[..., :3] = to_bytes(masonry(rng, st.material, st.wall, 128, 256))
    cv2.circle(image, (128, 80), 18, (*(int(v) for v in st.trim), 0), -1)
    cv2.circle(image, (128, 80), 14, (50, 60, 72, 0), -1)
    alpha = np.zeros((128, 256), np.uint8)
    cv2.fillPoly(alpha, [np.array([[0, 127], [128, 0], [255, 127]], np.int32)], (255,))
    image[..., 3] = alpha
    return image
