"""The library: ``from fdslam import ChangeDetector``.

The same stages as the pipeline's, on images that a program has: a map is fitted once, and each live image gets where it
was taken and what has changed. Of the map images nothing is kept but what the stages keep.
"""

from __future__ import annotations

import logging
import os
import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fdslam.compose import configured
from fdslam.config import Config
from fdslam.context import learned
from fdslam.data.live import frames_of, poses_of
from fdslam.detection import Detection, detections
from fdslam.detectors.registry import DETECTORS
from fdslam.errors import InputError
from fdslam.growth import check_photos
from fdslam.layers import Copying, Layered, Sealed
from fdslam.mapping import BowMap
from fdslam.models import load_models, out_of_their_world
from fdslam.pipeline import Outcome, outcome_of
from fdslam.progress import silence, single_threaded_inside
from fdslam.provenance import Stopwatch
from fdslam.queries import Located, context_of, locate, see
from fdslam.saved import ARTEFACTS, ROW, Manifest, new_folder, read_manifest
from fdslam.settings import as_words, check_live
from fdslam.store import Store
from fdslam.types import Dataset, Frame

log = logging.getLogger(__name__)
ROWS = {"paper": "FD", "tuned": "FD", "raw": "CC", "best": "FD+CC+EF"}  # of each mode, what is detected with


@dataclass(frozen=True)
class _Map:
    """A fitted map."""

    dataset: Dataset  # without queries
    bow: BowMap
    config: Config  # with how many of its images were learned from


class ChangeDetector:
    """Where an image was taken, and what has changed there since the map was made.

    ``row`` is what is detected with, e.g. ``"FD+CC+EF"``.

    Any number of threads may call ``detect`` while another updates: each sees the map before or after. Results depend
    on images and settings alone, and are those of ``python -m fdslam.run`` on the same images, to the last bit.
    """

    def __init__(
        self,
        mode: str = "best",
        detectors: str = "",
        settings: Sequence[str] = (),
        store: str | os.PathLike[str] | None = None,
        verbose: bool = False,
    ) -> None:
        """Choose how changes are detected; models are read, so what is wrong with one is told now.

        Args:
            mode: ``paper``, ``tuned``, ``raw`` or ``best`` (docs/modes.md).
            detectors: a row of the table, e.g. ``"FD"`` or ``"FD+AD+PC"``; without one the mode's: FD for ``paper`` and
                ``tuned``, CC for ``raw``, FD+CC+EF for ``best``.
            settings: any other keys as on the command line, e.g. ``["obb=j_b", "obb.yolo.weights=yolox_nano.onnx"]``;
                what a live image has not, as labels, is none.
            store: a folder that keeps what is computed of maps, so that fitting the same images again takes no time;
                without one a temporary folder does, which goes with the object.
            verbose: show progress on standard error.

        Raises:
            InputError: an unknown mode, detector or key, or a model that is missing or damaged.
        """
        self.row = detectors or ROWS.get(mode, "FD")
        self._words = {"mode": mode} | as_words(settings)
        self._verbose = verbose
        words = [f"{key}={value}" for key, value in self._words.items()]
        rows = ",".join(f"'{row}'" for row in dict.fromkeys((*self.row.split("+"), self.row)))
        # The data set is never read.
        self._config: Config = configured(["dataset=folder", "dataset.root=.", f"mix.rows=[{rows}]", *words])
        check_live(self._config)
        self._models = load_models(self._config)
        self._temporary = None if store else tempfile.TemporaryDirectory(prefix="fdslam-")
        self._store: Store = Store(self._temporary.name if self._temporary else os.path.expanduser(store or ""))
        if notice := out_of_their_world(self._config):
            log.warning(notice)
        self._lock = threading.Lock()  # of fit and update
        self._map: _Map | None = None

    @property
    def config(self) -> Config:
        """The whole configuration; ``learned`` says what a map that grew has learned from."""
        return self._config if self._map is None else self._map.config

    def __len__(self) -> int:
        """Return the number of map images."""
        return 0 if self._map is None else len(self._map.dataset.map)

    def fit(self, images: Any, poses: ArrayLike | None = None) -> ChangeDetector:
        """Build the map; a map that was there is replaced.

        Args:
            images: a folder of images, taken in the order of their names; or a sequence of paths and of images in
                memory, in the order of the path: numpy uint8 [H, W, 3] RGB, or torch [3, H, W], uint8 or float 0 … 1.
            poses: [M, 3] x, y in metres and heading in radians, for ``ad=pose``.

        Returns:
            The detector itself.

        Raises:
            InputError: no image, or one that cannot be used.
        """
        with self._working() as folder, self._lock:
            frames = frames_of(images, folder)
            self._replace(self._fitted(frames, poses_of(poses, len(frames))))
        return self

    def update(self, images: Any, poses: ArrayLike | None = None, learn: bool = True) -> ChangeDetector:
        """Append images to the map; a folder that it was loaded from stays as it is.

        FD and PC look at the new images alone. Other detectors learn from map images, so those of before must still be
        where they were, and as they were, if they are to learn again: images that came from memory are not kept.

        Args:
            images: as ``fit``.
            poses: as ``fit``, of the new images.
            learn: learn again, from all images unless the settings say ``learned=N``: the result is that of a fit on
                all of them. Or else keep what was learned: the result is that of a fit with ``learned=N``, the number
                of the images that were learned from, and needs no old image.

        Raises:
            InputError: as ``fit``, or a map image that is needed again and is gone or another. The map then stays as
                it was.
        """
        with self._working() as folder, self._lock:
            fitted = self._fitted_map()
            old = fitted.dataset
            frames = (*old.map, *frames_of(images, folder, len(old.map)))
            if learn and not 0 < self._config.learned == fitted.config.learned:
                check_photos(self.config.mix.detectors, old.map)
            more = poses_of(poses, len(frames) - len(old.map))
            if (old.poses is None) != (more is None):
                raise InputError("update: give poses for all map images, or for none")
            together = None if more is None else np.concatenate([old.poses, more])
            taught = 0 if learn else learned(fitted.config, len(old.map))
            self._replace(self._fitted(frames, together, taught))
        return self

    def detect(self, image: Any) -> Detection:
        """Return where one image was taken and what has changed in it.

        Args:
            image: a path, or an image in memory as in ``fit``.

        Raises:
            InputError: an image that cannot be used, or no map.
        """
        return self.detect_all([image])[0]

    def detect_all(self, images: Any) -> list[Detection]:
        """Return the same for several images, which are one pool.

        Several detectors are fused by the ranks of all cells of the pool, and candidates are the cells that stand
        highest in it: of many images an unchanged one may have none, and LoC can be compared between images.
        """
        with self._working() as folder:
            return detections(self.outcome(frames_of(images, folder)), self.row)

    def outcome(self, frames: Sequence[Frame], above: Store | None = None, watch: Stopwatch | None = None) -> Outcome:
        """Return what the pipeline finds in frames: for the report, which shows more than a ``Detection``.

        Args:
            frames: of live images.
            above: keeps what is computed of them; without it nothing is kept.
            watch: takes the time of every stage.
        """
        fitted, watch = self._fitted_map(), watch or Stopwatch()
        with silence(not self._verbose), single_threaded_inside():
            store = Layered(self._store, above)
            data = replace(fitted.dataset, query=tuple(frames))
            located = locate(fitted.config, data, self._models, store, watch, fitted.bow.on(store))
            return outcome_of(fitted.config, [see(fitted.config, located, store, watch)], watch)

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write the map to a folder; a map that was saved there is replaced.

        It is then all that ``load`` needs, beside the files of models that the settings name.

        Raises:
            InputError: no map, a folder of something else, or a disk that refuses. What was there then stays.
        """
        fitted = self._fitted_map()
        with new_folder(Path(folder).expanduser()) as made, silence(not self._verbose):
            copy = Store(made / ARTEFACTS)
            copying = Copying(self._store, copy)
            self._prepare(replace(fitted, bow=fitted.bow.on(copying)), copying)
            fitted.bow.bag.save(fitted.bow.on(copy).file)
            words = {**self._words, ROW: self.row}
            Manifest.of(words, fitted.dataset, fitted.config.learned).write(made)

    @classmethod
    def load(
        cls, folder: str | os.PathLike[str], settings: Sequence[str] = (), verbose: bool = False
    ) -> ChangeDetector:
        """Return the detector whose map was saved in a folder.

        Args:
            folder: as ``save`` wrote it; it has to stay there.
            settings: as in the constructor, in place of those that were saved, e.g. where weights lie on this machine.
            verbose: show progress on standard error.

        Raises:
            InputError: no such map, a damaged one, or one saved by a version of fdslam that computes otherwise.
        """
        root = Path(folder).expanduser()
        saved, given = read_manifest(root), as_words(settings)
        words = saved.words | given
        mode, row = words.pop("mode"), words.pop(ROW)
        try:
            made = cls(mode, row, [f"{key}={value}" for key, value in words.items()], verbose=verbose)
        except InputError as error:
            raise InputError(
                f"{error} (as {root} was saved; name what has moved with settings=[KEY=VALUE], or --set KEY=VALUE)"
            ) from error
        made._store = Layered(Store(root / ARTEFACTS), made._store)  # an update leaves the folder as it is
        sealed = Sealed(root / ARTEFACTS)
        data = saved.dataset()
        bow = BowMap(data.map, made.config.bow, made._models.library, sealed, made.config.workers)
        made._map = _Map(data, bow, made._taught(0 if "learned" in given else saved.learned))
        try:
            with silence(not verbose), single_threaded_inside():
                made._prepare(made._map, sealed)
        except InputError as error:
            raise InputError(
                f"{root}: the map is damaged, or was saved with other settings or models or by a version of fdslam "
                f"that computes otherwise; fit it again ({error})"
            ) from error
        return made

    @contextmanager
    def _working(self) -> Iterator[Path]:
        """A folder for the pixels of images in memory, which go when the work is done."""
        with tempfile.TemporaryDirectory(prefix="fdslam-") as folder:
            yield Path(folder)

    def _fitted_map(self) -> _Map:
        if self._map is None:
            raise InputError("there is no map yet; call fit(images) or ChangeDetector.load(folder) first")
        return self._map

    def _replace(self, fitted: _Map) -> None:
        old, self._map = self._map, fitted
        if old is None or self._temporary is None or old.bow.file == fitted.bow.file:
            return
        # Each map is a file, and nobody reads this one again: who still looks at it has it in memory.
        if old.bow.file.is_relative_to(self._temporary.name):
            old.bow.file.unlink(missing_ok=True)

    def _taught(self, images: int) -> Config:
        """Return the configuration with another number of images that are learned from; 0: the one that was given."""
        return replace(self._config, learned=images) if images else self._config

    def _fitted(self, frames: tuple[Frame, ...], poses: np.ndarray | None, taught: int = 0) -> _Map:
        if self.config.ad.places == "pose" and poses is None and "AD" in self.config.mix.detectors:
            raise InputError("ad=pose: give fit the poses of the map images, or choose ad=appearance or ad=time")
        learned(self._config, len(frames))
        times = np.arange(len(frames), dtype=np.float64)
        data = Dataset("live", frames, (), None, None, None, poses, times)
        bow = BowMap(frames, self.config.bow, self._models.library, self._store, self.config.workers)
        fitted = _Map(data, bow, self._taught(taught))
        with silence(not self._verbose), single_threaded_inside():
            self._prepare(fitted, self._store)
        return fitted

    def _prepare(self, fitted: _Map, store: Store) -> None:
        """Make, and read, all that the map keeps."""
        fitted.bow.prepare()  # what it knows from now on every look at a query shares
        located = Located(fitted.dataset, (), (), None, fitted.bow, 0.0, self._models.looks)
        context = context_of(fitted.config, located, store)
        for name in fitted.config.mix.detectors:
            DETECTORS[name].prepare(context)
