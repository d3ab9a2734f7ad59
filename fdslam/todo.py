"""What a run has still to do, counted stage by stage before it starts; what it finds stored is left out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from fdslam import keypoints, mapping
from fdslam.compact.source import Source
from fdslam.compact.training import made_up
from fdslam.config import Config
from fdslam.context import Context, learned
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
    queries, mapped = sum(queries for queries, _ in sizes.pairs), sum(sizes.maps)
    costly = {"BING", "YOLO"} & {*parse_library(config.obb.library)}
    times = len({*config.evaluation.curve_Y, config.evaluation.Y})
    uses = config.mix.detectors
    taught = [learned(config, count) for count in sizes.maps]
    return Todo(
        make=sizes.missing,
        masks=queries if config.mask.source == "deeplabv3plus" else 0,
        boxes=len(costly) * min(queries, sizes.images),
        features=sizes.images,
        learn=mapped,
        localise=queries,
        sift=sizes.images if "PC" in uses else 0,
        train=sum(taught) if "AD" in uses else 0,
        support=queries if "FD" in uses and config.fd.support else 0,
        fd=times * queries if "FD" in uses else 0,
        pc=times * queries if "PC" in uses else 0,
        ad=(1 if config.ad.hypotheses == "top1" else times) * queries if "AD" in uses else 0,
        looks=sizes.images if config.mix.compact else 0,
        evidence=queries if config.mix.compact else 0,
        pretend=times * sum(made_up(config.early, count) for count in taught) if "EF" in uses else 0,
    )


@dataclass
class _Lost:
    """What is not stored, gathered pair by pair; what pairs share, as maps and images, counts once."""

    counts: Counter[str] = field(default_factory=Counter)  # by the names of ``Todo``
    learn: dict[Key, int] = field(default_factory=dict)  # map images of each map that it does not hold
    train: dict[Key, int] = field(default_factory=dict)  # map images of places without a trained AE, of each map
    pretend: dict[Key, int] = field(default_factory=dict)  # map images to make up changes in, of each map
    sifts: set[Key] = field(default_factory=set)  # addresses of those that are needed
    support: set[Key] = field(default_factory=set)  # addresses of what is missing
    looks: set[Key] = field(default_factory=set)  # likewise


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
    every_sift = {comparison.features_key(frame, config.pc) for frame in frames} if "PC" in config.mix.detectors else ()
    lost = _Lost()
    for one in datasets:
        bow = mapping.BowMap(one.map, config.bow, library, store, config.workers)
        lost.counts["masks"] += missing_masks(one, model, store)
        _look_at(Context(config, one, store, (), (), (), bow, source), bow, lost, every_sift)
    lost.counts.update(
        boxes=Proposals(library, store, config.workers).missing([*queries]),
        features=store.lacks(keypoints.FEATURES, map(features.key, frames)),
        learn=sum(lost.learn.values()),
        sift=store.lacks(comparison.FEATURES, lost.sifts),
        train=sum(lost.train.values()),
        pretend=sum(lost.pretend.values()),
        support=len(lost.support),
        looks=len(lost.looks),
    )
    return Todo(**lost.counts)


def _look_at(context: Context, bow: mapping.BowMap, lost: _Lost, every_sift: Iterable[Key]) -> None:
    """Add to ``lost`` what a pair of sessions that is not localised yet lacks."""
    config, data = context.config, context.dataset
    times = sorted({*config.evaluation.curve_Y, config.evaluation.Y})
    if context.looks is not None:
        lost.looks |= compact.missing_looks(context)
    if "AD" in config.mix.detectors:
        lost.train[bow.keys[-1]] = untrained(context)
    lost.pretend[bow.keys[-1]] = _made_up(context, times)
    lost.learn[bow.keys[-1]], unknown = bow.missing(data.query)
    if unknown:  # what they will be compared with is not known
        lost.sifts.update(every_sift)
        lost.counts.update(_of_all(config, len(data.query), len(times)), localise=unknown)
        return
    keys, localizations = bow.localize(data.query)
    context = replace(context, localizations=tuple(localizations), localization_keys=tuple(keys))
    for y in times:
        best = hypotheses(replace(config.evaluation, Y=y), data, localizations)
        _compare(replace(context, hypotheses=best), lost, y == config.evaluation.Y)


def _of_all(config: Config, queries: int, times: int) -> Counter[str]:
    """Return what detectors have to do for all queries, for each of so many numbers of hypotheses."""
    each = {"FD": ("fd", times), "PC": ("pc", times), "AD": ("ad", 1)}
    uses = config.mix.detectors
    counts = Counter({name: count * queries for detector, (name, count) in each.items() if detector in uses})
    if "FD" in uses and config.fd.support:
        counts["support"] = queries
    if config.mix.compact:
        counts["evidence"] = queries
    return counts


def _made_up(context: Context, times: Sequence[int]) -> int:
    """Count the map images that early fusion still has to make up changes in: it learns for each Y anew."""
    config = context.config
    if "EF" not in config.mix.detectors:
        return 0
    each = (replace(config, evaluation=replace(config.evaluation, Y=y)) for y in times)
    return sum(early.missing(replace(context, config=one)) for one in each)


def _compare(context: Context, lost: _Lost, first: bool) -> None:
    """Add to ``lost`` what detectors lack for the hypotheses of a context.

    Args:
        context: a pair of sessions, localised.
        lost: what is missing so far.
        first: whether these are the hypotheses of the table itself, and not of a curve over Y alone.
    """
    config, uses = context.config, context.config.mix.detectors
    if "PC" in uses:
        count, sifts = comparison.missing(context)
        lost.counts["pc"] += count
        lost.sifts |= sifts
    if "FD" in uses:
        count, support = fault_diagnosis.missing(context)
        lost.counts["fd"] += count
        lost.support |= support
    if context.looks is not None and first:  # it looks at the same images for any Y but the smallest
        lost.counts["evidence"] += compact.missing(context)
    if "AD" in uses and (first or config.ad.hypotheses == "min"):
        lost.counts["ad"] += anomaly.missing(context)
