"""Raw images of NCLT, made upright once.

The cameras stand on their side, so every reader would have to turn what it reads. Instead the upright image is made
once, without loss, and kept as a PNG in the store: a frame's path is always what is to be seen, by detectors and by a
person who draws boxes alike. Its file is named after the raw image, so that a person finds it, and after a key made of
the raw image's content and of the undistortion, so that it never is another image's.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from fdslam.data.images import LIBRARIES, image_size, read_image
from fdslam.data.ledger import known_digest, remembered_digest
from fdslam.data.nclt.undistortion import Undistortion, read_undistortion
from fdslam.errors import InputError
from fdslam.progress import in_parallel, progress
from fdslam.store import Arrays, Key, Stage, Store, write_atomically
from fdslam.types import Frame, Image

_SHOWN = 16  # hex digits of the key in the name of a PNG
UPRIGHT = Stage("upright", ("fdslam.data.nclt.upright",), LIBRARIES)


@dataclass(frozen=True)
class _Missing:
    """A raw image whose upright one is not there yet."""

    name: str
    raw: Path
    key: Key
    png: Path


def turn_upright(raw: Image, name: Path, undistortion: Undistortion | None = None) -> Image:
    """Undistort a raw image if asked to and turn it by 90° clockwise; ``name`` is for the error.

    Raises:
        InputError: it is in portrait, so it was turned before, or does not fit the undistortion.
    """
    if raw.shape[0] > raw.shape[1]:
        raise InputError(
            f"{name}: {raw.shape[1]}×{raw.shape[0]} pixels is upright already; dataset=nclt wants the raw images, "
            "dataset=folder takes upright ones"
        )
    flat = undistortion(raw, name) if undistortion else raw
    return np.asarray(cv2.rotate(flat, cv2.ROTATE_90_CLOCKWISE), np.uint8)


def make_upright(files: Mapping[str, Path], table: Path | None, store: Store, workers: int) -> dict[str, Frame]:
    """Return the upright frame of every raw image, making those that the store lacks.

    Args:
        files: name of the frame -> raw image.
        table: of the undistortion; None: leave the distortion as it is.
        store: holds the upright images.
        workers: parallel workers; each has one image in hand.

    Raises:
        InputError: an image that cannot be read, or no room for what is to be made.
    """
    settings = {"undistortion": remembered_digest(table, store) if table else ""}
    looked = in_parallel((partial(_look, name, raw, settings, store) for name, raw in files.items()), workers)
    found = list(progress(looked, len(files), "raw images"))
    frames = [one for one in found if isinstance(one, Frame)]
    missing = [one for one in found if isinstance(one, _Missing)]
    if missing:
        _check_room(missing, store)
        undistortion = read_undistortion(table) if table else None
        made = in_parallel((partial(_make, one, undistortion, store) for one in missing), workers)
        frames += progress(made, len(missing), "turning images upright")
    return {frame.name: frame for frame in frames}


def count_missing(files: Mapping[str, Path], table: Path | None, store: Store) -> int:
    """Count the raw images that have no upright one: for estimates, as one whose digest is not known counts too."""
    settings = {"undistortion": remembered_digest(table, store) if table else ""}

    def made(name: str, raw: Path) -> bool:
        digest = known_digest(raw, store)
        return digest is not None and _png(name, UPRIGHT.key(settings, [digest]), store).is_file()

    return sum(not made(name, raw) for name, raw in files.items())


def _png(name: str, key: Key, store: Store) -> Path:
    return (store.root / "upright_images" / name).with_name(f"{Path(name).stem}-{key[:_SHOWN]}.png")


def _look(name: str, raw: Path, settings: dict[str, str], store: Store) -> Frame | _Missing:
    try:
        key = UPRIGHT.key(settings, [remembered_digest(raw, store)])
    except OSError as error:
        raise InputError(f"{raw}: cannot be read ({error.strerror or error}); copy it again from its source") from error
    png = _png(name, key, store)
    record = store.get(UPRIGHT, key)
    if record is None or not png.is_file() or remembered_digest(png, store) != record["sha256"].tobytes().hex():
        return _Missing(name, raw, key, png)
    return _frame(name, png, record)


def _frame(name: str, png: Path, record: Arrays) -> Frame:
    height, width = record["size"].tolist()
    return Frame(name, png, record["sha256"].tobytes().hex(), height, width)


def _check_room(missing: list[_Missing], store: Store) -> None:
    height, width = image_size(missing[0].raw)  # one camera's images are all of one size
    needed = 3 * height * width * len(missing)
    store.root.mkdir(parents=True, exist_ok=True)
    free = shutil.disk_usage(store.root).free
    if free < needed:
        raise InputError(
            f"store={store.root}: {len(missing)} upright images may take up to {needed / 1e9:.2g} GB, "
            f"{free / 1e9:.2g} GB are free; choose another disk with store=DIR or fewer images with dataset.every"
        )


def _make(one: _Missing, undistortion: Undistortion | None, store: Store) -> Frame:
    image = turn_upright(read_image(one.raw), one.raw, undistortion)
    png = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))[1].tobytes()
    write_atomically(one.png, png)
    record = {"sha256": np.frombuffer(hashlib.sha256(png).digest(), np.uint8), "size": np.array(image.shape[:2])}
    store.put(UPRIGHT, one.key, record)
    return _frame(one.name, one.png, record)
