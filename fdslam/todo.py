"""What a run has still to do, counted stage by stage before it starts; what it finds stored is left out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from fdslam import keypoints, mapping
from fdslam.compact.source import Source
from fdslam.compact.training import made_up
from fdslam.config import Config
from fdslam.context import Context
from fdslam.data import Outline
from fdslam.detectors import anomaly, compact, comparison, early, fault_diagnosis
from fdslam.hypotheses import hypotheses
from fdslam.mask import missing_masks
from fdslam.obb import Library, parse_library
from fdslam.place_models import untrained
from fdslam.proposals import Proposals
from fdslam.store import Key, Store
from fdslam.types import Dataset

if TYPE_CHECKING:
    from fdslam.segmentation import Segmentation


@dataclass(frozen=True)
class Todo:
    """What is still to be done; what a run finds stored is left out."""

    make: int = 0  # images to render or to turn upright
    masks: int = 0  # queries that the model of the mask looks at
    boxes: int = 0  # looks at images by BING and YOLO
    features: int = 0  # images without ORB features
    learn: int = 0  # map images that no map holds yet
    localise: int = 0  # queries
    sift: int = 0  # images without SIFTs; at most so many are compared
    train: int = 0  # map images of places without a trained AE
    support: int = 0  # queries whose keypoints look for words of the map
    fd: int = 0  # queries that FD looks at, once for each Y
    pc: int = 0  # likewise PC
    ad: int = 0  # likewise AD
    looks: int = 0  # images without dense descriptors
    evidence: int = 0  # queries that the compact map is asked about, once for each Y
    pretend: int = 0  # map images in which changes are still to be made up


def everything(config: Config, sizes: Outline) -> Todo:
    """Return all there is to do where images are still to be made: what comes after them is not known yet."""
    queries, learned = sum(queries for queries, _ in sizes.pairs), sum(sizes.maps)
    costly = {"BING", "YOLO"} & {*parse_library(config.obb.library)}
    times = len({*config.evaluation.curve_Y, config.evaluation.Y})
    uses = config.mix.detectors
    return Todo(
        make=sizes.missing,
        masks=queries if config.mask.source == "deeplabv3plus" else 0,
        boxes=len(costly) * min(queries, sizes.images),
        features=sizes.images,
        learn=learned,
        localise=queries,
        sift=sizes.images if "PC" in uses else 0,
        train=learned if "AD" in uses else 0,
        support=queries if "FD" in uses and config.fd.support else 0,
        fd=times * queries if "FD" in uses else 0,
        pc=times * queries if "PC" in uses else 0,
        ad=(1 if config.ad.hypotheses == "top1" else times) * queries if "AD" in uses else 0,
        looks=sizes.images if config.mix.compact else 0,
        evidence=queries if config.mix.compact else 0,
        pretend=times * sum(made_up(config.early, count) for count in sizes.maps) if "EF" in uses else 0,
    )


def remaining(
    config: Config,
    datasets: Sequence[Dataset],
    library: Library,
    model: Segmentation | None,
    store: Store,
    source: Source | None = None,
) -> Todo:
    """Return what is not stored yet of a run on loaded data sets; of what is stored hardly more than names is read.

    Args:
        config: of the run.
        datasets: its pairs of sessions.
        library: its sources of OBBs.
        model: of its mask, if that needs one.
        store: where results are looked for.
        source: of dense descriptors, if a detector needs them.
    """
    queries = {frame.digest: frame for one in datasets for frame in one.query}.values()
    frames = {frame.digest: frame for one in datasets for frame in (*one.map, *one.query)}.values()
    features = keypoints.FeatureStore(config.bow, store, config.workers)
    learn, train, sifts, support = dict[str, int](), dict[str, int](), set[Key](), set[Key]()
    looks, pretend = set[Key](), 0
    counts = Counter[str](boxes=Proposals(library, store, config.workers).missing([*queries]))
    every_sift = {comparison.features_key(frame, config.pc) for frame in frames}
    times, uses = sorted({*config.evaluation.curve_Y, config.evaluation.Y}), config.mix.detectors
    for one in datasets:
        bow = mapping.BowMap(one.map, config.bow, library, store, config.workers)
        learn[bow.keys[-1]], lost = bow.missing(one.query)
        context = Context(config, one, store, (), (), (), bow, source)
        if source is not None:
            looks |= compact.missing_looks(context)
        pretend += _made_up(context, times)
        train[bow.keys[-1]] = untrained(context) if "AD" in uses else 0
        counts.update(localise=lost, masks=missing_masks(one, model, store))
        if lost:  # what they will be compared with is not known
            sifts |= every_sift
            counts.update(fd=len(times) * len(one.query), pc=len(times) * len(one.query), ad=len(one.query))
            counts.update(support=len(one.query) if config.fd.support else 0, evidence=len(one.query))
            continue
        keys, localizations = bow.localize(one.query)
        for y in times:
            evaluation = replace(config.evaluation, Y=y)
            best = hypotheses(evaluation, one, localizations)
            context = replace(context, localizations=tuple(localizations), localization_keys=tuple(keys))
            context = replace(context, hypotheses=best)
            found, needed, unsupported = _lacking(context, y == config.evaluation.Y)
            counts += found
            sifts |= needed
            support |= unsupported
    return Todo(
        masks=counts["masks"],
        boxes=counts["boxes"],
        features=store.lacks(keypoints.FEATURES, map(features.key, frames)),
        learn=sum(learn.values()),
        localise=counts["localise"],
        sift=store.lacks(comparison.FEATURES, sifts) if "PC" in uses else 0,
        train=sum(train.values()),
        support=counts["support"] + len(support) if "FD" in uses else 0,
        fd=counts["fd"] if "FD" in uses else 0,
        pc=counts["pc"] if "PC" in uses else 0,
        ad=counts["ad"] if "AD" in uses else 0,
        looks=len(looks),
        evidence=counts["evidence"] if source is not None else 0,
        pretend=pretend,
    )


def _made_up(context: Context, times: Sequence[int]) -> int:
    """Count the map images that early fusion still has to make up changes in: it learns for each Y anew."""
    config = context.config
    if "EF" not in config.mix.detectors:
        return 0
    each = (replace(config, evaluation=replace(config.evaluation, Y=y)) for y in times)
    return sum(early.missing(replace(context, config=one)) for one in each)


def _lacking(context: Context, first: bool) -> tuple[Counter[str], set[Key], set[Key]]:
    """Count what detectors lack for the hypotheses of a context; also return the addresses of SIFTs and word support.

    Args:
        context: a pair of sessions, localised.
        first: whether these are the hypotheses of the table itself, and not of a curve over Y alone.
    """
    config, counts, sifts = context.config, Counter[str](), set[Key]()
    uses = config.mix.detectors
    if "PC" in uses:
        counts["pc"], sifts = comparison.missing(context)
    counts["fd"], support = fault_diagnosis.missing(context)
    if context.looks is not None and first:  # it looks at the same images for any Y but the smallest
        counts["evidence"] = compact.missing(context)
    if "AD" in uses and (first or config.ad.hypotheses == "min"):
        counts["ad"] = anomaly.missing(context)
    return counts, sifts, support
