"""Small scenes for the tests: partial border cells, boxes across the border, tiny boxes, queries of several sizes."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from scipy.stats import rankdata

from fdslam.metrics import Scene
from fdslam.metrics.seeds import generator
from fdslam.types import grid_shape

SIZES = ((35, 42), (35, 42), (38, 50), (9, 13), (60, 25))  # the first two and the third share the grid 4 × 5


def make(names, sizes, boxes):
    boxes = tuple(np.array(b, dtype=np.float32).reshape(-1, 4) for b in boxes)
    return Scene(tuple(names), tuple(h for h, _ in sizes), tuple(w for _, w in sizes), boxes)


def ties(scene, seed):
    """The random key of every cell: what the order among equal values is defined by."""
    sizes = [np.prod(grid_shape(h, w)) for h, w in zip(scene.heights, scene.widths, strict=True)]
    return [generator(seed, "ties", name).random(int(n)) for name, n in zip(scene.names, sizes, strict=True)]


def permuted(scene, order):
    return Scene(*(tuple(part[i] for i in order) for part in (scene.names, scene.heights, scene.widths, scene.boxes)))


@st.composite
def boxes_in(draw, height, width, most=3):
    boxes = []
    for _ in range(draw(st.integers(0, most))):
        x, y = draw(st.integers(-8, width - 1)), draw(st.integers(-8, height - 1))
        w, h = draw(st.integers(1, 30)), draw(st.integers(1, 30))
        boxes.append((x, y, x + w, y + h))
    return boxes


@st.composite
def scenes(draw, most=4):
    sizes = draw(st.lists(st.sampled_from(SIZES), min_size=1, max_size=most))
    letters = draw(st.permutations("abcdef"))
    return make(letters[: len(sizes)], sizes, [draw(boxes_in(h, w)) for h, w in sizes])


@st.composite
def scenes_with_maps(draw, most=4):
    """A scene with LoC of few distinct values (many ties) or of many."""
    scene = draw(scenes(most))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    levels = draw(st.sampled_from([1, 3, 10**6]))
    shapes = [grid_shape(h, w) for h, w in zip(scene.heights, scene.widths, strict=True)]
    return scene, [rng.integers(0, levels, shape).astype(np.float32) for shape in shapes]


def ranks_of(scene, loc):
    """Rank the cells of a scene by their LoC, equal ones alike."""
    return rankdata(scene.flatten("map", loc), method="min").astype(int)
