"""What is true of the queries: their names, sizes and changed objects, with everything that all methods share.

Inside, queries are sorted by name and the boxes of a query by their coordinates, so that no result depends on the
order in which either is listed. A "cell" below is a number 0…N-1 that runs over all cells of the sorted queries, each
query row by row.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fdslam.errors import InputError
from fdslam.metrics.cells import box_overlap, positive_cells
from fdslam.metrics.seeds import generator
from fdslam.types import Dataset, grid_shape


@dataclass(frozen=True, eq=False)
class Objects:
    """The O annotated boxes of all queries, sorted by query name and coordinates."""

    query: NDArray[np.int64]  # [O] the query (sorted by name) of each
    listed: NDArray[np.int64]  # [O] its place in the order in which the scene was given
    area: NDArray[np.float64]  # [O] square pixels inside the image
    cells: tuple[NDArray[np.int64], ...]  # [O] of [c]: the cells that each touches
    overlap: tuple[NDArray[np.float64], ...]  # [O] of [c]: square pixels it shares with them
    positive: tuple[NDArray[np.int64], ...]  # [O] of [p]: the cells that are positive by this box alone


@dataclass(frozen=True, eq=False)
class Scene:
    """The queries as they were given. What is derived is computed once, at first use, and shared by all methods."""

    names: tuple[str, ...]  # [Q] unique, and the seed of what is random about each
    heights: tuple[int, ...]  # [Q] pixels
    widths: tuple[int, ...]  # [Q] pixels
    boxes: tuple[NDArray[np.float32], ...]  # [Q] of [n, 4] xyxy of changed objects; [0, 4]: unchanged
    images: tuple[str, ...] = ()  # [Q] which image each is, where several queries are one; empty: each its own
    shown: tuple[str, ...] = ()  # [Q] how each is called in messages; empty: by its name
    _chances: dict[int, NDArray[np.integer]] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        """Raise InputError if a name occurs twice or the fields differ in length."""
        given = [part for part in (self.images, self.shown) if part]
        if len({len(part) for part in (self.names, self.heights, self.widths, self.boxes, *given)}) > 1:
            raise InputError("scene: names, heights, widths, boxes, images and shown must have one entry per query")
        if len(set(self.names)) < len(self.names):
            twice = next(self._shown(i) for i, name in enumerate(self.names) if name in self.names[:i])
            raise InputError(f"scene: two queries are named {twice!r}; give every query its own name")

    @classmethod
    def of(cls, data: Dataset, names: Sequence[str]) -> Scene:
        """Return what is true of the queries of an annotated data set, under these names; equal images are one."""
        assert data.boxes is not None
        frames = data.query
        return cls(
            tuple(names),
            tuple(frame.height for frame in frames),
            tuple(frame.width for frame in frames),
            data.boxes,
            images=tuple(frame.digest for frame in frames),
            shown=tuple(frame.name for frame in frames),
        )

    def image_of(self, query: int) -> str:
        """Return which image a query (as listed) is."""
        return self.images[query] if self.images else self.names[query]

    def _shown(self, query: int) -> str:
        return self.shown[query] if self.shown else self.names[query]

    @cached_property
    def by_name(self) -> tuple[int, ...]:
        """[Q] the listed position of each query of the sorted order."""
        return tuple(sorted(range(len(self.names)), key=self.names.__getitem__))

    @cached_property
    def shapes(self) -> tuple[tuple[int, int], ...]:
        """[Q] rows and columns of each sorted query's grid."""
        return tuple(grid_shape(self.heights[i], self.widths[i]) for i in self.by_name)

    @cached_property
    def sizes(self) -> NDArray[np.int64]:
        """[Q] number of cells n_q of each sorted query."""
        return np.array([rows * cols for rows, cols in self.shapes], dtype=np.int64)

    @cached_property
    def starts(self) -> NDArray[np.int64]:
        """[Q + 1] first cell of each sorted query; the last entry is N."""
        return np.concatenate([[0], np.cumsum(self.sizes)]).astype(np.int64)

    @cached_property
    def query_of(self) -> NDArray[np.int32]:
        """[N] the sorted query that each cell belongs to."""
        return np.repeat(np.arange(len(self.sizes), dtype=np.int32), self.sizes)

    def by_chance(self, seed: int) -> NDArray[np.integer]:
        """[N] the cells in a random order, which is that of equal LoC; int32 where that is enough.

        It depends on the seed and the names of the queries only, and is the same for all methods.
        """
        if seed not in self._chances:
            keys = [
                generator(seed, "ties", self.names[i]).random(n) for i, n in zip(self.by_name, self.sizes, strict=True)
            ]
            order = np.argsort(np.concatenate([np.zeros(0), *keys]), kind="stable")
            self._chances[seed] = order.astype(np.int32 if len(order) < 2**31 else np.int64)
        return self._chances[seed]

    @cached_property
    def unchanged(self) -> NDArray[np.int64]:
        """[U] the sorted queries without any box."""
        return np.array([q for q, i in enumerate(self.by_name) if not len(self.boxes[i])], dtype=np.int64)

    @cached_property
    def objects(self) -> Objects:
        """The boxes, with the cells that each touches."""
        first = np.concatenate([[0], np.cumsum([len(b) for b in self.boxes])]).astype(np.int64)
        found = []
        for q, i in enumerate(self.by_name):
            boxes, start = np.asarray(self.boxes[i]).reshape(-1, 4), self.starts[q]
            for b in np.lexsort(boxes.T):
                overlap = box_overlap(boxes[b], self.heights[i], self.widths[i]).ravel()
                cells = np.flatnonzero(overlap)
                mine = np.flatnonzero(positive_cells(boxes[b], self.heights[i], self.widths[i]))
                found.append((q, first[i] + b, overlap.sum(), cells + start, overlap[cells], mine + start))
        query, listed, area, touched, overlaps, positive = zip(*found, strict=True) if found else [()] * 6
        integers = (np.array(query, dtype=np.int64), np.array(listed, dtype=np.int64))
        return Objects(*integers, np.array(area, dtype=np.float64), touched, overlaps, positive)

    @cached_property
    def positive(self) -> NDArray[np.bool_]:
        """[N] whether a cell is positive by some box."""
        mask = np.zeros(self.starts[-1], dtype=bool)
        for cells in self.objects.positive:
            mask[cells] = True
        return mask

    def flatten(self, method: str, loc: Sequence[NDArray[np.floating]]) -> NDArray[np.floating]:
        """Return the cells of a method's maps in the order of this scene's cells.

        Args:
            method: its name, for the message.
            loc: per query, as listed, the LoC [rows, cols] of its cells, float32 or float64.

        Returns:
            [N] LoC, same dtype.

        Raises:
            InputError: a map is missing, has another shape than its query's grid, or holds NaN.
        """
        if len(loc) != len(self.names):
            raise InputError(f"{method}: {len(loc)} maps for {len(self.names)} queries; there must be one per query")
        for i, shape in zip(self.by_name, self.shapes, strict=True):
            if np.shape(loc[i]) != shape:
                raise InputError(f"{method}: the map of {self._shown(i)} is {np.shape(loc[i])} cells, not {shape}")
        flat = np.concatenate([np.zeros(0, np.float32), *(np.ravel(loc[i]) for i in self.by_name)])
        bad = np.isnan(flat)
        if bad.any():
            name = self._shown(self.by_name[self.query_of[np.argmax(bad)]])
            raise InputError(f"{method}: the map of {name} holds NaN; every cell needs a LoC")
        return flat
