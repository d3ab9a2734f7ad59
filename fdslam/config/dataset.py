"""The data sets and their switches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from omegaconf import MISSING

from fdslam.config.options import Checked, option
from fdslam.errors import InputError


@dataclass
class Dataset(Checked):
    """Where the images come from; the options of the group `dataset` extend it."""

    group: ClassVar[str | None] = "dataset"

    kind: str = MISSING
    radius: float = option(5.0, "same place by pose: distance at most this, metres", low=0)
    angle: float = option(45.0, "same place by pose: headings differ at most this, degrees", low=0, high=180)
    tolerance: int = option(3, "same place without poses: at most this many indices apart on one drive", low=0)
    all_pairs: bool = option(False, "where there are sessions: every ordered pair; `query` and `map` are then not said")


@dataclass
class Folder(Dataset):
    """A folder with map/, query/ and, where known, annotations, map.csv, pairs.csv and labels/."""

    kind: str = option("folder", "this data set", choices=("folder",))
    root: str = MISSING
    annotations: str = option("", "COCO or CVAT file, or LabelMe folder; empty: what is found in the root")
    classes: list[str] = option([], "labels that count as a change; none: all", empty=True)


@dataclass
class Pairs(Dataset):
    """Aligned image pairs with masks of change, t0 before and t1 after."""

    kind: str = option("pairs", "this data set", choices=("pairs",))
    root: str = MISSING
    layout: str = option(
        "auto",
        "how the set lies on disk, see fdslam/data/layouts.py; auto: the first that fits",
        choices=("auto", "vl_cmu_cd", "pcd", "pscd", "changesim", "plain"),
    )
    direction: str = option(
        "t0_to_t1", "from the map to the queries: which image is which", choices=("t0_to_t1", "t1_to_t0")
    )
    changed: str = option(
        "auto",
        "the colour of change in a black and white mask; auto: as the layout has it",
        choices=("auto", "white", "black"),
    )
    min_area: int = option(100, "connected areas with fewer pixels are no object", low=1)


@dataclass
class Rendering(Checked):
    """What decides how the embedded world looks."""

    seed: int = option(4, "which campus", low=0, high=2**32 - 1)
    images: int = option(384, "images of the four sessions together", low=4, high=100_000)
    width: int = option(308, "image width, pixels", low=64, high=4096)
    height: int = option(404, "image height, pixels", low=64, high=4096)


_SESSIONS = ("WI", "SP", "SU", "AU", "all", "")


def _chosen(settings: Campus | Nclt, query: str, map: str) -> tuple[str, str]:
    """Return the query and map session that are meant; the arguments are what is meant where nothing is said.

    Raises:
        InputError: all pairs are wanted, and a session too.
    """
    if settings.all_pairs and (settings.query or settings.map):
        raise InputError(
            f"dataset.query={settings.query} dataset.map={settings.map}: dataset.all_pairs=true, as in "
            "experiment=table1, runs every pair; add dataset.all_pairs=false to choose"
        )
    return ("all", "all") if settings.all_pairs else (settings.query or query, settings.map or map)


@dataclass
class Campus(Rendering, Dataset):
    """The embedded world: rendered on first use, deterministic in its seed and sizes."""

    kind: str = option("campus", "this data set", choices=("campus",))
    query: str = option("", "session of the queries, AU if not said; all: each but the map's", choices=_SESSIONS)
    map: str = option("", "session of the map, SU if not said; all: each but the query's", choices=_SESSIONS)
    objects: int = option(1200, "annotated objects of the twelve pairs together, at most", low=0)
    distractors: int = option(288, "queries without change of the twelve pairs together, at most", low=0)

    def __post_init__(self) -> None:
        """Raise InputError for a value out of range, or for one session as both query and map."""
        super().__post_init__()
        query, map = self.chosen
        if query == map != "all":
            raise InputError(f"dataset.query={query} dataset.map={map}: choose two different sessions, or all")

    @property
    def chosen(self) -> tuple[str, str]:
        """The query and the map session, or all."""
        return _chosen(self, "AU", "SU")


@dataclass
class Nclt(Dataset):
    """NCLT as it lies on disk: sessions named by their dates, raw images of a Ladybug3 (docs/nclt.md)."""

    kind: str = option("nclt", "this data set", choices=("nclt",))
    root: str = MISSING
    query: str = option("", "query session: a date, WI, SP, SU, AU, or all of `sessions`, which it is if not said")
    map: str = option("", "map session, likewise; all ordered pairs of different sessions are run")
    sessions: list[str] = option(["2012-01-22", "2012-03-31", "2012-08-04", "2012-11-17"], "what `all` means")
    camera: str = option("Cam5", "of the Ladybug3; Cam5 looks ahead", choices=tuple(f"Cam{i}" for i in range(6)))
    undistort: bool = option(False, "undistort with U2D_CamN_1616X1232.txt before turning upright")
    every: float = option(5.0, "least distance between images that are kept, metres; 0: any", low=0)
    seconds: float = option(0.0, "least time between images that are kept, seconds; 0: any", low=0)
    gap: float = option(1.0, "largest gap between two poses that is bridged, seconds", low=0, high=1e6)
    annotations: str = option("annotations", "folder of <query date>_<map date>.json, COCO; relative to `root`")

    @property
    def chosen(self) -> tuple[str, str]:
        """The query and the map session, or all."""
        return _chosen(self, "all", "all")


DATASETS = (Folder, Pairs, Campus, Nclt)  # the options of the group `dataset`
