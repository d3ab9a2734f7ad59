"""A saved map: a folder with a manifest and the artefacts that detection reads."""

from __future__ import annotations

import importlib.metadata
import json
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fdslam.compose import FOLDERS
from fdslam.errors import InputError
from fdslam.store import write_atomically
from fdslam.types import Dataset, Frame

MANIFEST, ARTEFACTS = "map.json", "artefacts"
ROW = "detectors"  # beside the keys of the configuration: the row that changes are detected with
FORMAT = 1


@dataclass(frozen=True)
class Manifest:
    """What a saved map was made from."""

    words: dict[str, str]  # key -> value, as on the command line
    frames: tuple[Frame, ...]  # names, digests and sizes; the path is where the image was
    poses: list[list[float]] | None
    learned: int  # how many of them were learned from; 0: all

    @classmethod
    def of(cls, words: Mapping[str, str], data: Dataset, learned: int) -> Manifest:
        """Return the manifest of a map; files that the settings name are then found from anywhere."""
        absolute = {
            key: str(Path(value.strip("'\"")).expanduser().absolute()) if key in FOLDERS and value else value
            for key, value in words.items()
        }
        return cls(absolute, data.map, None if data.poses is None else data.poses.tolist(), learned)

    def write(self, folder: Path) -> None:
        """Write it into a folder, last of all: it says that the map is whole."""
        frames = [[one.name, str(one.path.absolute()), one.digest, one.height, one.width] for one in self.frames]
        told = {
            "format": FORMAT,
            "fdslam": importlib.metadata.version("fdslam"),
            "settings": self.words,
            "images": frames,
            "poses": self.poses,
            "learned": self.learned,
        }
        write_atomically(folder / MANIFEST, as_utf8(told))

    def dataset(self) -> Dataset:
        """Return the map as a data set without queries."""
        times = np.arange(len(self.frames), dtype=np.float64)
        poses = None if self.poses is None else np.array(self.poses, np.float64)
        return Dataset("live", self.frames, (), None, None, None, poses, times)


def as_utf8(told: Any) -> bytes:
    """Return a value as JSON; what is no Unicode in the name of a file is escaped, and read again as it was."""
    return (json.dumps(told, indent=1, ensure_ascii=False) + "\n").encode(errors="backslashreplace")


def is_saved(folder: Path) -> bool:
    """Tell whether a folder holds a saved map."""
    return (folder / MANIFEST).is_file()


def read_manifest(folder: Path) -> Manifest:
    """Return the manifest of a saved map.

    Raises:
        InputError: none there, damaged, or of another format.
    """
    path = folder / MANIFEST
    try:
        told: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        if told["format"] != FORMAT:
            raise InputError(f"{path}: a map of format {told['format']}, this program reads {FORMAT}; fit it again")
        words = {str(key): str(value) for key, value in told["settings"].items()}
        frames = tuple(
            Frame(str(name), Path(where), str(digest), int(height), int(width))
            for name, where, digest, height, width in told["images"]
        )
        if not frames or not {"mode", ROW} <= words.keys():
            raise ValueError("no images, no mode or no detectors")
        poses = told["poses"]
        if poses is not None and np.array(poses, np.float64).shape != (len(frames), 3):
            raise ValueError("not a pose for each image")
        learned = told.get("learned", 0)
        if type(learned) is not int or not 0 <= learned <= len(frames):
            raise ValueError(f"learned from {learned} of {len(frames)} images")
        return Manifest(words, frames, poses, learned)
    except FileNotFoundError:
        raise InputError(
            f"{folder}: no saved map ({MANIFEST} is not there); save one with ChangeDetector.save"
        ) from None
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: cannot be read as a saved map ({error}); fit the map again and save it") from error


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Give an empty folder that takes the place of ``folder`` when all is written; after an error nothing has changed.

    Raises:
        InputError: there is something else than a saved map, or beside it, or the disk refuses.
    """
    if folder.exists() and not is_saved(folder) and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder}: is there and no saved map; choose a new folder")
    if is_saved(folder) and (other := {path.name for path in folder.iterdir()} - {MANIFEST, ARTEFACTS}):
        raise InputError(f"{folder}: holds {min(other)} beside the saved map; move that away or choose a new folder")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        made = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}."))
        try:
            inner = made / "map"
            inner.mkdir()
            yield inner
            try:
                if folder.exists():
                    folder.rename(made / "old")
                inner.rename(folder)
            except BaseException:  # an interruption as well: what is in ``made`` goes
                if (made / "old").exists() and not folder.exists():
                    (made / "old").rename(folder)
                raise
        finally:
            shutil.rmtree(made, ignore_errors=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror or error}); choose another folder") from error
