"""Detectors of the compact binary map: CC by its dense descriptors, WC and MW by its words (beyond the paper).

CC is the smallest share of descriptor bits that differ around where the map images say a thing should be; WC the share
of the keypoints around a cell that have no partner there; MW the share of the map's words that should be seen around a
cell and are not. Nothing is learned.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from fdslam.bow.around import candidates
from fdslam.compact.alignment import Aligned, align
from fdslam.compact.evidence import evidence
from fdslam.compact.map import SIGNS, CompactMap
from fdslam.compact.sequence import pooled
from fdslam.config import Alignment, Compact, part
from fdslam.context import Context, Detected, learned
from fdslam.store import Arrays, Key, Stage
from fdslam.types import Cells

EVIDENCE = Stage(
    "compact_evidence",
    ("fdslam.detectors.compact", "fdslam.mapping"),
    ("opencv-python-headless", "numpy", "scipy"),
)


def compact_map(context: Context) -> CompactMap:
    """Return the compact map of a run."""
    assert context.bow is not None  # the pipeline gives it
    assert context.looks is not None
    config, frames = context.config, context.dataset.map
    taught = learned(config, len(frames))
    return CompactMap(frames, context.looks, config.compact, context.bow, context.store, config.workers, taught)


def evidence_keys(context: Context, kept: CompactMap) -> list[Key]:
    """Return the address of every query's evidence."""
    config = context.config.compact
    return [
        EVIDENCE.key(part(config, Alignment), [kept.centring_key, key, *map(str, hypotheses[: config.hypotheses])])
        for key, hypotheses in zip(context.localization_keys, context.hypotheses, strict=True)
    ]


def missing_looks(context: Context) -> set[Key]:
    """Return the addresses of the images whose dense descriptors are not stored."""
    kept, data = compact_map(context), context.dataset
    return {key for key in map(kept.key, (*data.map, *data.query)) if context.store.lacks(SIGNS, [key])}


def missing(context: Context) -> int:
    """Count the queries without stored evidence."""
    return context.store.lacks(EVIDENCE, evidence_keys(context, compact_map(context)))


def aligned(context: Context, kept: CompactMap, query: int) -> list[Aligned]:
    """Return the map images that a query is compared with, those with most agreeing keypoints first."""
    frame, config, bow = context.dataset.query[query], context.config.compact, context.bow
    assert bow is not None
    images = candidates(context.hypotheses[query], len(kept.frames), config.hypotheses, config.neighbours)
    return align(bow.keypoints(frame), (frame.height, frame.width), images, kept.words, kept.size, config)


def all_evidence(context: Context, kept: CompactMap) -> list[Arrays]:
    """Return the evidence of every query, as ``compact.evidence`` gives it."""
    data, config, bow = context.dataset, context.config.compact, context.bow
    assert bow is not None

    def look(query: int) -> Arrays:
        frame = data.query[query]
        size, images = (frame.height, frame.width), aligned(context, kept, query)
        looks = kept.looks(frame)
        return evidence(bow.keypoints(frame), looks, size, images, lambda m: kept.looks(data.map[m]), config)

    keys = evidence_keys(context, kept)
    if context.store.lacks(EVIDENCE, keys):
        kept.ensure([*data.map, *data.query], "looks")
    return context.fetch(EVIDENCE, keys, look, "compact comparison")


def _detected(context: Context, name: str) -> Detected:
    kept = compact_map(context)
    return Detected([one[name] for one in all_evidence(context, kept)], kept.kept())


def prepare(context: Context) -> None:
    """Make and read the compact map."""
    kept = compact_map(context)
    kept.ensure(kept.frames, "looks of the map")
    kept.kept()
    for frame in kept.frames:
        kept.looks(frame)


def detect(context: Context) -> Detected:
    """Return the LoC of every query by its dense descriptors (CC)."""
    kept, config = compact_map(context), context.config.compact
    loc = [compared(one, config) for one in all_evidence(context, kept)]
    return Detected(over_queries(context, loc), kept.kept())


def compared(one: Arrays, config: Compact) -> Cells:
    """Return the LoC of CC from the evidence of a query."""
    cells = config.fine * one["fine"] + (1 - config.fine) * one["coarse"]
    return (gaussian_filter(cells, config.sigma) if config.sigma else cells).astype(np.float32)


def over_queries(context: Context, loc: list[Cells]) -> list[Cells]:
    """Return the LoC of every query averaged with that of those before it, if ``compact.previous`` says so."""
    frames, bow = context.dataset.query, context.bow
    assert bow is not None
    sizes = [(frame.height, frame.width) for frame in frames]
    return pooled(loc, sizes, lambda query: bow.keypoints(frames[query]), context.config.compact.previous)


def new_words(context: Context) -> Detected:
    """Return the LoC of every query by its keypoints without a partner (WC)."""
    return _detected(context, "words")


def missing_words(context: Context) -> Detected:
    """Return the LoC of every query by the words that should be seen and are not (MW)."""
    return _detected(context, "missing")
