"""Early fusion (EF): one learner looks at what all detectors without pixels have found in a cell and around it.

The paper names it as future work. It is trained while the map is built, on changes made up in the map's own images
(``compact.training``), or it is the shipped one, which was trained so on the embedded world and knows no place.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fdslam.compact.features import features
from fdslam.compact.map import CompactMap
from fdslam.compact.shipped import shipped_trees
from fdslam.compact.training import fd_of, lacking, made_up, trained
from fdslam.compact.trees import Trees
from fdslam.context import Context, Detected
from fdslam.detectors.compact import all_evidence, compact_map, over_queries


def trees_of(context: Context, kept: CompactMap) -> Trees:
    """Return the learner that the configuration wants."""
    if not made_up(context.config.early, len(context.dataset.map)):
        return shipped_trees(context.config)
    assert context.bow is not None
    return trained(context, kept, context.bow.identity)


def missing(context: Context) -> int:
    """Count the map images in which changes are still to be made up."""
    if not made_up(context.config.early, len(context.dataset.map)):
        return 0
    assert context.bow is not None
    return lacking(context, compact_map(context), context.bow.identity)


def detect(context: Context) -> Detected:
    """Return the LoC of every query: the log odds that a cell has changed."""
    data, config = context.dataset, context.config
    kept = compact_map(context)
    trees = trees_of(context, kept)
    seen = all_evidence(context, kept)

    def loc(query: int) -> NDArray[np.float32]:
        frame = data.query[query]
        size = frame.height, frame.width
        fd = fd_of(context.localizations[query], context.hypotheses[query], size, len(data.map), config.fd)
        return trees.log_odds(features(seen[query], fd).astype(np.float64)).reshape(fd.shape).astype(np.float32)

    learned = sum(array.nbytes for array in trees.arrays().values())
    found = over_queries(context, [loc(query) for query in range(len(data.query))])
    return Detected(found, kept.kept() + learned / len(data.map))
