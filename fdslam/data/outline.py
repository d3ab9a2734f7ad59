"""How many images a run has to do with, before one of them is made: what an estimate starts from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fdslam.config import Campus, Rendering, part
from fdslam.data.campus import SESSIONS
from fdslam.data.campus.pairs import PAIRS, shares
from fdslam.data.embedded import VIEW
from fdslam.store import Store
from fdslam.types import Dataset


@dataclass(frozen=True)
class Outline:
    """The sizes of a data set."""

    images: int  # different ones, of all sessions together
    missing: int  # of them still to be rendered or turned upright
    maps: tuple[int, ...]  # images of each different map
    pairs: tuple[tuple[int, int], ...]  # of each pair of sessions the queries and the map images
    height: int  # pixels
    width: int  # pixels
    annotated: bool = True  # something is known to have changed, or not


def outline(datasets: Sequence[Dataset]) -> Outline:
    """Return the sizes of what is loaded."""
    maps = {tuple(frame.digest for frame in one.map): len(one.map) for one in datasets}
    frames = {frame.digest for one in datasets for frame in (*one.map, *one.query)}
    first = datasets[0].query[0]
    pairs = tuple((len(one.query), len(one.map)) for one in datasets)
    annotated = any(one.boxes is not None for one in datasets)
    return Outline(len(frames), 0, tuple(maps.values()), pairs, first.height, first.width, annotated)


def outline_campus(settings: Campus, store: Store) -> Outline:
    """Return the sizes of the embedded world; of queries there may be fewer."""
    query, map_ = settings.chosen
    pairs = [(q, m) for q, m in PAIRS if query in (q, "all") and map_ in (m, "all")]
    counts = shares(settings.images, SESSIONS)
    used = {name: counts[name] for pair in pairs for name in pair}
    look = part(settings, Rendering)
    views = [VIEW.key(look, [name, str(i)]) for name, count in used.items() for i in range(count)]
    objects, distractors = shares(settings.objects, PAIRS), shares(settings.distractors, PAIRS)
    return Outline(
        images=len(views),
        missing=store.lacks(VIEW, views),
        maps=tuple(counts[one] for one in dict.fromkeys(m for _, m in pairs)),
        pairs=tuple((min(objects[pair] + distractors[pair], counts[pair[0]]), counts[pair[1]]) for pair in pairs),
        height=settings.height,
        width=settings.width,
    )
