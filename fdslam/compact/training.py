"""Early fusion learned from a map's own images, each localised in the map without itself, with changes made up in it.

No label and no query is looked at. Map images are needed while the map is built; what is kept are the trees.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier

from fdslam.bow.around import candidates
from fdslam.compact.alignment import align
from fdslam.compact.evidence import evidence
from fdslam.compact.features import NAMES, fd_level, features
from fdslam.compact.grid import cell_means
from fdslam.compact.map import CompactMap
from fdslam.compact.pseudo import Mask, pseudo_query
from fdslam.compact.trees import Trees
from fdslam.config import Alignment, Early, Fd, Training, part
from fdslam.context import Context, load
from fdslam.data.images import LIBRARIES, read_image
from fdslam.detectors.fault_diagnosis import loc_cells
from fdslam.errors import InputError
from fdslam.sampling import evenly
from fdslam.store import Arrays, Key, Stage
from fdslam.types import Cells, Image, Localization

PSEUDO = Stage("pseudo_query", ("fdslam.compact.training", "fdslam.mapping"), ("scipy", *LIBRARIES))
TREES = Stage("early_fusion", ("fdslam.compact.training", "fdslam.mapping"), ("scikit-learn", "scipy", *LIBRARIES))
FAR = 10  # map images apart: farther ones show another place
DONORS = 4  # other images that patches are cut from
CHANGED, UNCHANGED = 0.5, 0.05  # share of a cell that is foreign: at least, at most; between them it is neither
NEITHER = 2


def fd_of(found: Localization, hypotheses: NDArray[np.int64], size: tuple[int, int], images: int, config: Fd) -> Cells:
    """Return FD's level of a query's cells, by the ranks alone and without the OBBs of a detector of objects.

    Those would tell where objects are. Made-up changes are none, and real objects of the map, which are labelled as
    unchanged, are: the learner would take a box for a sign that nothing has changed.
    """
    told = np.array([source != "YOLO" for source in found.boxes.source], bool)
    ranks = found.ranks[told][:, hypotheses].astype(np.int32)
    return fd_level(loc_cells(found.boxes.xyxy[told], ranks, *size, config), images)


def made_up(config: Early, images: int) -> int:
    """Return how many changed images a map of so many is trained on; 0 where the shipped learner is used."""
    if config.model == "shipped" or (config.model == "auto" and images < config.least):
        return 0
    return config.rounds * min(config.images, images)


def chosen(images: int, config: Training) -> list[int]:
    """Return the map ids that changes are made up in, evenly spread."""
    return evenly(images, config.images)


def turns(images: int, config: Training) -> list[tuple[int, int]]:
    """Return the round and the map id of every image with made-up changes."""
    return [(turn, m) for turn in range(config.rounds) for m in chosen(images, config)]


def pseudo_keys(context: Context, kept: CompactMap) -> list[Key]:
    """Return the addresses of the features of all made-up changes, in the order of ``turns``."""
    config, bow = context.config, context.bow
    assert bow is not None  # the pipeline gives it
    settings = {
        **part(config.compact, Alignment),
        **{f"fd.{name}": getattr(config.fd, name) for name in ("pooling", "order", "mean", "weights")},
        "Y": config.evaluation.Y,
        "seed": config.seed,
    }
    frames = context.dataset.map
    return [
        PSEUDO.key({**settings, "round": turn}, [bow.identity, kept.centring_key, str(m), frames[m].digest])
        for turn, m in turns(len(frames), config.early)
    ]


def drawn(context: Context, image: int, turn: int) -> tuple[Image, Mask]:
    """Return a map image with changes made up in it, and which share of each pixel is foreign."""
    frames = context.dataset.map
    rng = np.random.default_rng([context.config.seed, turn, image])
    far = [m for m in range(len(frames)) if abs(m - image) > min(FAR, len(frames) // 4)]
    donors = rng.choice(far, min(DONORS, len(far)), replace=False).tolist() if far else []
    return pseudo_query(read_image(frames[image].path), [read_image(frames[m].path) for m in donors], rng)


def pseudo_rows(context: Context, kept: CompactMap, image: int, turn: int) -> Arrays:
    """Return the features and the labels of the cells of a map image with changes made up in it."""
    config, frames, bow = context.config, context.dataset.map, context.bow
    assert bow is not None  # the pipeline gives it
    picture, mask = drawn(context, image, turn)
    query, found = bow.localize_without(picture, image)
    size = picture.shape[0], picture.shape[1]
    hypotheses = found.strong[: config.evaluation.Y].astype(np.int64)
    best = candidates(hypotheses, len(frames), config.compact.hypotheses, config.compact.neighbours)
    others = [m for m in best if m != image]
    words = partial(bow.words_without, without=image)
    aligned = align(query, size, others, words, kept.size, config.compact)
    seen = evidence(query, kept.look(picture), size, aligned, lambda m: kept.looks(frames[m]), config.compact)
    fd = fd_of(found, hypotheses, size, len(frames), config.fd)
    share = cell_means(mask)
    label = np.where(share >= CHANGED, 1, np.where(share <= UNCHANGED, 0, NEITHER))
    return {"features": features(seen, fd), "label": label.astype(np.uint8).ravel()}


def made_up_rows(context: Context, kept: CompactMap) -> list[Arrays]:
    """Return what ``pseudo_rows`` gives for every image of ``turns``; what is stored is used."""
    frames = context.dataset.map
    kept.ensure(frames, "looks of the map")
    which = turns(len(frames), context.config.early)

    def make(position: int) -> Arrays:
        turn, m = which[position]
        return pseudo_rows(context, kept, m, turn)

    return context.fetch(PSEUDO, pseudo_keys(context, kept), make, "made-up changes")


def trained(context: Context, kept: CompactMap) -> Trees:
    """Return the trees of a map, trained on its own images; what is stored is used.

    Args:
        context: the map and the switches.
        kept: the compact map.

    Raises:
        InputError: a map in which nothing can be made up to have changed.
    """
    key = _key(context, pseudo_keys(context, kept))
    found = load(context.store, TREES, key, lambda: _fit(context, kept).arrays())
    return Trees.from_arrays(found)


def lacking(context: Context, kept: CompactMap) -> int:
    """Count the map images in which changes are still to be made up; none where the trees are stored."""
    keys = pseudo_keys(context, kept)
    return context.store.lacks(PSEUDO, keys) if context.store.lacks(TREES, [_key(context, keys)]) else 0


def _key(context: Context, keys: list[Key]) -> Key:
    return TREES.key({**part(context.config.early, Training), "seed": context.config.seed}, keys)


def _fit(context: Context, kept: CompactMap) -> Trees:
    found = made_up_rows(context, kept)
    rows, label = sure_cells([one["features"] for one in found], [one["label"] for one in found])
    return fit(rows, label, context.config.early, context.config.seed)


def sure_cells(
    rows: Sequence[NDArray[np.float32]], label: Sequence[NDArray[np.uint8]]
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Return the features and labels of the cells of all images, without those that are neither changed nor not."""
    every, told = np.concatenate(rows), np.concatenate(label)
    return every[told != NEITHER], told[told != NEITHER]


def fit(rows: NDArray[np.float32], label: NDArray[np.uint8], config: Training, seed: int) -> Trees:
    """Return trees trained to tell changed cells (label 1) from others (0) by their features, float32 [n, features].

    Raises:
        InputError: all cells have the same label.
    """
    if rows.shape[1] != len(NAMES) or len(np.unique(label)) < 2:
        raise InputError(
            "early fusion: the map's images are too few or too small to make up changes in; "
            "run with early.model=shipped"
        )
    return boosted(rows, label, config, seed)


def boosted(rows: NDArray[np.float32], label: NDArray[np.uint8], config: Training, seed: int) -> Trees:
    """Return trees trained as ``fit`` does, on any features."""
    model = HistGradientBoostingClassifier(
        learning_rate=config.rate,
        max_iter=config.trees,
        max_leaf_nodes=config.leaves,
        min_samples_leaf=config.leaf,
        l2_regularization=config.l2,
        early_stopping=False,
        random_state=seed,
    )
    return Trees.of(model.fit(rows, label))
