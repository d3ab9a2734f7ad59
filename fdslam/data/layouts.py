"""How published change-detection sets lie on disk: a plain dict from a layout's name to the function that lists pairs.

A set comes as aligned image pairs, t0 before and t1 after, with masks of what has changed. The layouts are those that
the sets' own loaders, or the loaders of published work on them, read; no copy of the sets was at hand.

- ``vl_cmu_cd``  VL-CMU-CD (Alcantarilla et al., RSS 2016), sequences along a street. As released:
  ``[train|test/]SEQUENCE/RGB/1_NN.png`` (t0) and ``2_NN.png`` (t1), ``SEQUENCE/GT/gtNN.png`` in colours. Or the binary
  version: ``[train|test/]{t0,t1,mask}/SEQUENCE_1_NN_TURN.png``, of which the turned copies (TURN > 0) are no pairs
  (github.com/DoctorKey/C-3PO, src/dataset/vl_cmu_cd.py).
- ``pcd``        TSUNAMI and GSV (Sakurada and Okatani, BMVC 2015), panoramas of unconnected places:
  ``[TSUNAMI|GSV/]{t0,t1}/NNNNNNNN.jpg`` and ``ground_truth/NNNNNNNN.bmp``, where black has changed, or
  ``mask/NNNNNNNN.png``, converted from them (github.com/kensakurada/sscdnet, README), where white has.
- ``pscd``       PSCD (Sakurada et al., ICRA 2020), panoramas: ``{t0,t1,mask_t0,mask_t1}/NAME.png``, one mask for each
  image; anything but 0 has changed (as loaders of work after arXiv:2409.16850 read it).
- ``changesim``  ChangeSim (Park et al., IROS 2021), sequences through a warehouse:
  ``…/SEQUENCE/{rgb,t0/rgb,change_segmentation}/N.png``, in five colours (github.com/SAMMiCA/ChangeSim,
  script/dataloader.py).
- ``plain``      ``[train|test/]{t0,t1,mask}/NAME.*``, black and white.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from fdslam.data.images import SUFFIXES
from fdslam.errors import InputError


@dataclass(frozen=True)
class Pair:
    """Two images of one place and the masks of what has changed between them."""

    name: str  # unique in its set
    t0: Path
    t1: Path
    mask_t0: Path | None  # as t0 shows it; None: the set does not say
    mask_t1: Path | None  # as t1 shows it
    reading: str  # what the colours of the masks mean, a key of fdslam.data.masks.READINGS
    sequence: str | None = None  # the pairs of one sequence follow each other along a path, in the order of the set


def find_pairs(root: Path, layout: str = "auto") -> tuple[str, list[Pair]]:
    """Return the layout of a set and its pairs, in order; names are looked at, no image is opened.

    Args:
        root: the folder of the set.
        layout: a key of ``LAYOUTS``, or auto: the first that fits.

    Raises:
        InputError: none fits, or an image or a mask lacks its partner.
    """
    names = list(LAYOUTS) if layout == "auto" else [layout]
    for name in names:
        if pairs := LAYOUTS[name](root):
            return name, pairs
    looked = "; ".join(f"{name}: {LOOKED_FOR[name]}" for name in names)
    raise InputError(f"{root}: no image pairs found; looked for {looked}")


def _natural(text: str) -> list[tuple[int, int | str]]:
    """Order 2 before 10, as people number."""
    return [(0, int(part)) if part.isdecimal() else (1, part) for part in re.split(r"(\d+)", text) if part]


def _holding(root: Path, wanted: tuple[str, ...], depth: int) -> list[Path]:
    """Return the folders that hold all the wanted subfolders: ``root``, or else those at most ``depth`` below."""
    if all((root / name).is_dir() for name in wanted):
        return [root]
    if depth == 0 or not root.is_dir():
        return []
    below = sorted((path for path in root.iterdir() if path.is_dir()), key=lambda path: _natural(path.name))
    return [found for path in below for found in _holding(path, wanted, depth - 1)]


def _images(folder: Path) -> dict[str, Path]:
    """Return the images of a folder by their names without suffix."""
    found: dict[str, Path] = {}
    for path in sorted(folder.iterdir(), key=lambda path: _natural(path.name)):
        if path.suffix.lower() in SUFFIXES and found.setdefault(path.stem, path) is not path:
            raise InputError(f"{path}: {found[path.stem].name} has the same name; one image, one name: remove one")
    return found


def _aligned(folders: list[Path]) -> Iterator[tuple[str, list[Path]]]:
    """Yield a name and its image in each of the folders, which must have the same names."""
    images = [_images(folder) for folder in folders]
    for name in sorted(set().union(*images), key=_natural):
        for folder, there in zip(folders, images, strict=True):
            if name not in there:
                partner = next(other[name] for other in images if name in other)
                raise InputError(
                    f"{folder / name}.*: no such image, but there is {partner}; add it or remove its partners "
                    "(an all-black mask says that nothing has changed)"
                )
        yield name, [there[name] for there in images]


def _prefixed(root: Path, folder: Path, name: str) -> str:
    return (folder.relative_to(root) / name).as_posix()


def _vl_cmu_cd(root: Path) -> list[Pair]:
    released = _holding(root, ("RGB", "GT"), 2)
    if released:
        return [pair for folder in released for pair in _vl_sequence(root, folder)]
    pairs = []
    for folder in _holding(root, ("t0", "t1", "mask"), 1):
        for name, (t0, t1, mask) in _aligned([folder / part for part in ("t0", "t1", "mask")]):
            parts = re.fullmatch(r"(\d+)_1_\d+_(\d)", name)
            if not parts:
                return []
            if parts[2] == "0":
                sequence = _prefixed(root, folder, parts[1])
                pairs.append(Pair(_prefixed(root, folder, name), t0, t1, mask, mask, "white", sequence))
    return pairs


def _vl_sequence(root: Path, folder: Path) -> Iterator[Pair]:
    images, masks = _images(folder / "RGB"), _images(folder / "GT")
    for stem, mask in masks.items():
        number = stem.removeprefix("gt")
        pair = [images.get(f"{session}_{number}") for session in (1, 2)]
        for session, path in enumerate(pair, 1):
            if path is None:
                raise InputError(f"{folder / 'RGB' / f'{session}_{number}'}.*: no such image, but there is {mask}")
        t0, t1 = pair
        assert t0 is not None
        assert t1 is not None
        name = _prefixed(root, folder, number)
        yield Pair(name, t0, t1, mask, mask, "coloured", _prefixed(root, folder, ""))


def _pcd(root: Path) -> list[Pair]:
    pairs = []
    for folder in _holding(root, ("t0", "t1"), 1):
        released = (folder / "ground_truth").is_dir()
        masks = folder / ("ground_truth" if released else "mask")
        if not masks.is_dir():
            return []
        for name, (t0, t1, mask) in _aligned([folder / "t0", folder / "t1", masks]):
            if not released and not re.fullmatch(r"\d{8}", name):
                return []
            reading = "black" if released else "white"
            pairs.append(Pair(_prefixed(root, folder, name), t0, t1, mask, mask, reading))
    return pairs


def _pscd(root: Path) -> list[Pair]:
    return [
        Pair(_prefixed(root, folder, name), t0, t1, mask_t0, mask_t1, "nonzero")
        for folder in _holding(root, ("t0", "t1", "mask_t0", "mask_t1"), 1)
        for name, (t0, t1, mask_t0, mask_t1) in _aligned([folder / part for part in ("t0", "t1", "mask_t0", "mask_t1")])
    ]


def _changesim(root: Path) -> list[Pair]:
    return [
        Pair(_prefixed(root, folder, name), t0, t1, None, mask, "changesim", _prefixed(root, folder, ""))
        for folder in _holding(root, ("rgb", "t0/rgb", "change_segmentation"), 4)
        for name, (t0, t1, mask) in _aligned([folder / part for part in ("t0/rgb", "rgb", "change_segmentation")])
    ]


def _plain(root: Path) -> list[Pair]:
    return [
        Pair(_prefixed(root, folder, name), t0, t1, mask, mask, "white")
        for folder in _holding(root, ("t0", "t1", "mask"), 1)
        for name, (t0, t1, mask) in _aligned([folder / part for part in ("t0", "t1", "mask")])
    ]


LAYOUTS: dict[str, Callable[[Path], list[Pair]]] = {
    "changesim": _changesim,
    "vl_cmu_cd": _vl_cmu_cd,
    "pscd": _pscd,
    "pcd": _pcd,
    "plain": _plain,
}
LOOKED_FOR = {
    "changesim": "rgb/, t0/rgb/ and change_segmentation/",
    "vl_cmu_cd": "RGB/ and GT/, or t0/, t1/ and mask/ with names like 005_1_02_0",
    "pscd": "t0/, t1/, mask_t0/ and mask_t1/",
    "pcd": "t0/, t1/ and ground_truth/, or mask/ with names like 00000012",
    "plain": "t0/, t1/ and mask/ with the same names",
}
