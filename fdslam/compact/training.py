"""Early fusion learned from a map's own images, each localised in the map without itself, with changes made up in it.

No label and no query is looked at. Map images are needed while the map is built; what is kept are the trees.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier

from fdslam.bow.around import candidates
from fdslam.compact.alignment import align
from fdslam.compact.evidence import evidence
from fdslam.compact.features import NAMES, fd_level, features
from fdslam.compact.map import CompactMap
from fdslam.compact.pseudo import pseudo_query
from fdslam.compact.trees import Trees
from fdslam.config import Alignment, Early, Fd, Training, part
from fdslam.context import Context, ensure, load
from fdslam.data.images import LIBRARIES, read_image
from fdslam.detectors.fault_diagnosis import loc_cells
from fdslam.errors import InputError
from fdslam.store import Arrays, Key, Stage
from fdslam.types import CELL, Cells, Localization

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
    count = min(config.images, images)
    return np.linspace(0, images - 1, count).round().astype(int).tolist()


def pseudo_keys(context: Context, kept: CompactMap, model: str) -> list[Key]:
    """Return the addresses of the features of all made-up changes; ``model`` is what decides the map and its OBBs."""
    config = context.config
    settings = {
        **part(config.compact, Alignment),
        **{f"fd.{name}": getattr(config.fd, name) for name in ("pooling", "order", "mean", "weights")},
        "Y": config.evaluation.Y,
        "seed": config.seed,
    }
    frames = context.dataset.map
    return [
        PSEUDO.key({**settings, "round": turn}, [model, kept.centring_key, str(m), frames[m].digest])
        for turn in range(config.early.rounds)
        for m in chosen(len(frames), config.early)
    ]


def pseudo_rows(context: Context, kept: CompactMap, image: int, turn: int) -> Arrays:
    """Return the features and the labels of the cells of a map image with changes made up in it."""
    config, frames, bow = context.config, context.dataset.map, context.bow
    assert bow is not None  # the pipeline gives it
    rng = np.random.default_rng([config.seed, turn, image])
    far = [m for m in range(len(frames)) if abs(m - image) > min(FAR, len(frames) // 4)]
    donors = rng.choice(far, min(DONORS, len(far)), replace=False).tolist() if far else []
    drawn, mask = pseudo_query(read_image(frames[image].path), [read_image(frames[m].path) for m in donors], rng)
    query, found = bow.localize_without(drawn, image)
    size = drawn.shape[0], drawn.shape[1]
    hypotheses = found.strong[: config.evaluation.Y].astype(np.int64)
    best = candidates(hypotheses, len(frames), config.compact.hypotheses, config.compact.neighbours)
    others = [m for m in best if m != image]
    words = partial(bow.words_without, without=image)
    aligned = align(query, size, others, words, kept.size, config.compact)
    seen = evidence(query, kept.look(drawn), size, aligned, lambda m: kept.looks(frames[m]), config.compact)
    fd = fd_of(found, hypotheses, size, len(frames), config.fd)
    share = _cell_shares(mask)
    label = np.where(share >= CHANGED, 1, np.where(share <= UNCHANGED, 0, NEITHER))
    return {"features": features(seen, fd), "label": label.astype(np.uint8).ravel()}


def _cell_shares(mask: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the mean of a mask in each cell, [rows, cols], those at the border of what is inside."""
    rows, cols = (np.arange(0, n, CELL) for n in mask.shape)
    sums = np.add.reduceat(np.add.reduceat(mask.astype(np.float64), rows, axis=0), cols, axis=1)
    areas = np.outer(np.diff(np.append(rows, mask.shape[0])), np.diff(np.append(cols, mask.shape[1])))
    return sums / areas


def trained(context: Context, kept: CompactMap, model: str) -> Trees:
    """Return the trees of a map, trained on its own images; what is stored is used.

    Args:
        context: the map and the switches.
        kept: the compact map.
        model: what decides the map and its OBBs.

    Raises:
        InputError: a map in which nothing can be made up to have changed.
    """
    keys = pseudo_keys(context, kept, model)
    found = load(context.store, TREES, _key(context, keys), lambda: _fit(context, kept, keys).arrays())
    return Trees.from_arrays(found)


def lacking(context: Context, kept: CompactMap, model: str) -> int:
    """Count the map images in which changes are still to be made up; none where the trees are stored."""
    keys = pseudo_keys(context, kept, model)
    return context.store.lacks(PSEUDO, keys) if context.store.lacks(TREES, [_key(context, keys)]) else 0


def _key(context: Context, keys: list[Key]) -> Key:
    return TREES.key({**part(context.config.early, Training), "seed": context.config.seed}, keys)


def _fit(context: Context, kept: CompactMap, keys: list[Key]) -> Trees:
    config, frames = context.config, context.dataset.map
    kept.ensure(frames, "looks of the map")
    which = [(turn, m) for turn in range(config.early.rounds) for m in chosen(len(frames), config.early)]
    jobs = {key: partial(pseudo_rows, context, kept, m, turn) for key, (turn, m) in zip(keys, which, strict=True)}
    ensure(context.store, PSEUDO, jobs, config.workers, "made-up changes")
    found = [load(context.store, PSEUDO, key, jobs[key]) for key in keys]
    rows = np.concatenate([one["features"] for one in found])
    label = np.concatenate([one["label"] for one in found])
    return fit(rows[label != NEITHER], label[label != NEITHER], config.early, config.seed)


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
    model = HistGradientBoostingClassifier(
        learning_rate=config.rate,
        max_iter=config.trees,
        max_leaf_nodes=config.leaves,
        early_stopping=False,
        random_state=seed,
    )
    return Trees.of(model.fit(rows, label))
