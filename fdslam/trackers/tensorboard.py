"""TensorBoard: an event file for every run, by TensorBoard's own writer of records."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from PIL import Image

from fdslam.trackers.record import Name, Record
from fdslam.trackers.tracker import check_folder

if TYPE_CHECKING:
    from tensorboard.compat.proto.summary_pb2 import Summary


def tag(name: Name) -> str:
    """Return a name as TensorBoard groups it; a slash inside a part, which would make a group, is written %2F."""
    return "/".join(part.replace("%", "%25").replace("/", "%2F") for part in name)


class TensorBoard:
    """Keeps a folder of events for every run, under ``tensorboard/NAME/LABEL``.

    Figures and losses are scalars, the latter over epochs or folds, pictures images, the table a text, and the
    configuration hyperparameters. Beside the events lies the run's ``run.json``.
    """

    needs: ClassVar[dict[str, str]] = {"tensorboard": "tensorboard"}

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def check(self) -> None:
        """Raise OSError if the folder cannot be written."""
        check_folder(self.folder)

    def note(self, record: Record) -> str:
        """Write the events of a run, and say in which folder they are."""
        for target in self._targets(record):
            if _identity(target) == record.identity:
                return str(target)
        self.check()
        # Elsewhere first: TensorBoard shows what is in its folder, and a kill would leave half a run there.
        begun = Path(tempfile.mkdtemp(dir=self.folder, prefix=".unfinished_"))
        try:
            _write(begun, record)
            return str(self._move(begun, record))
        finally:
            shutil.rmtree(begun, ignore_errors=True)

    def _targets(self, record: Record) -> Iterator[Path]:
        """Yield the folders that a run of this label may lie in, as far as they exist, and the next one."""
        base = self.folder / "tensorboard" / record.name / record.label
        for number in count(1):
            target = base if number == 1 else base.with_name(f"{base.name}_{number}")
            yield target
            if not target.exists():
                return

    def _move(self, begun: Path, record: Record) -> Path:
        os.chmod(begun, 0o755)  # mkdtemp makes folders that nobody else may read
        while True:
            *_, free = self._targets(record)
            free.parent.mkdir(parents=True, exist_ok=True)
            try:
                return begun.rename(free)
            except OSError:
                if not free.exists():  # or another job was quicker
                    raise


def _identity(target: Path) -> str | None:
    path = target / "identity.txt"
    return path.read_text(encoding="ascii") if path.is_file() else None


def _write(folder: Path, record: Record) -> None:
    from tensorboard.compat.proto.event_pb2 import Event
    from tensorboard.summary.writer.record_writer import RecordWriter

    start = time.time()
    with (folder / f"events.out.tfevents.{int(start):010d}.fdslam").open("wb") as file:
        # Its EventFileWriter writes in a thread of its own, and an error there would pass unseen.
        writer = RecordWriter(file)
        writer.write(Event(wall_time=start, file_version="brain.Event:2").SerializeToString())
        for step, summary in _summaries(record):
            writer.write(Event(wall_time=start, step=step, summary=summary).SerializeToString())
        file.flush()
        os.fsync(file.fileno())
    for path in record.files:
        shutil.copyfile(path, folder / path.name)
    (folder / "identity.txt").write_text(record.identity, encoding="ascii")


def _summaries(record: Record) -> Iterator[tuple[int, Summary]]:
    from tensorboard.plugins.hparams.summary_v2 import hparams_pb
    from tensorboard.plugins.scalar.summary_v2 import scalar_pb
    from tensorboard.plugins.text.summary_v2 import text_pb

    yield 0, hparams_pb({key: _value(text) for key, text in record.parameters.items()}, trial_id=record.identity)
    yield 0, text_pb("table", record.text)
    for name, value in record.figures.items():
        yield 0, scalar_pb(tag(name), value)
    for name, points in record.curves.items():
        for step, value in points:
            yield step, scalar_pb(tag(name), value)
    for path in record.pictures:
        yield 0, _picture(path)


def _value(text: str) -> Any:
    """Return a number as such, so that TensorBoard sorts by it."""
    return float(text) if re.fullmatch(r"-?\d+(\.\d+)?(e-?\d+)?", text) else text


def _picture(path: Path) -> Summary:
    from tensorboard.compat.proto.summary_pb2 import Summary

    with Image.open(path) as image:
        width, height, channels = *image.size, len(image.getbands())
    shown = Summary.Image(height=height, width=width, colorspace=channels, encoded_image_string=path.read_bytes())
    return Summary(value=[Summary.Value(tag=tag(("pictures", path.stem)), image=shown)])
