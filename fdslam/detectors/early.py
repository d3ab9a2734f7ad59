"""Early fusion (EF): one learner looks at what all detectors without pixels have found in a cell and around it.

The paper names it as future work. It is trained while the map is built, on changes made up in the map's own images
(``compact.training``), or it is the shipped one, which was trained so on the embedded world and knows no place.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from fdslam.compact.features import features
from fdslam.compact.shipped import shipped_trees
from fdslam.compact.training import fd_of, lacking, made_up, trained
from fdslam.compact.trees import Trees
from fdslam.context import Context, Detected
from fdslam.detectors import compact
from fdslam.detectors.compact import all_evidence, compact_map, over_queries
from fdslam.store import Arrays
from fdslam.types import grid_shape


def trees_of(context: Context) -> Trees:
    """Return the learner that the configuration wants."""
    then = context.learned()
    if not made_up(context.config.early, len(then.dataset.map)):
        return shipped_trees(context.config)
    return trained(then, compact_map(then))


def missing(context: Context) -> int:
    """Count the map images in which changes are still to be made up."""
    then = context.learned()
    if not made_up(context.config.early, len(then.dataset.map)):
        return 0
    return lacking(then, compact_map(then))


def rows_of(context: Context, seen: Sequence[Arrays]) -> Iterator[NDArray[np.float32]]:
    """Yield the features of the cells of every query, from its evidence and where it was localised."""
    images, config = len(context.dataset.map), context.config.fd
    places = zip(context.dataset.query, seen, context.localizations, context.hypotheses, strict=True)
    for frame, one, found, best in places:
        yield features(one, fd_of(found, best, (frame.height, frame.width), images, config))


def prepare(context: Context) -> None:
    """Make and read the compact map, and the learner."""
    compact.prepare(context)
    trees_of(context)


def detect(context: Context) -> Detected:
    """Return the LoC of every query: the log odds that a cell has changed."""
    kept = compact_map(context)
    trees = trees_of(context)
    rows = rows_of(context, all_evidence(context, kept))
    shapes = [grid_shape(frame.height, frame.width) for frame in context.dataset.query]
    found = over_queries(context, [trees.loc(*one) for one in zip(rows, shapes, strict=True)])
    forest = sum(array.nbytes for array in trees.arrays().values())
    return Detected(found, kept.kept() + forest / len(context.dataset.map))
