"""ONNX models: read whole, checked, and run by onnxruntime; a session is made once in a process for each model.

The bytes that are hashed are the bytes that are run, so a result's key names the very weights that made it. One image
at a time goes through a model: nothing depends on what else is in a batch.
"""

from __future__ import annotations

import ast
import hashlib
import logging
import math
import re
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from fdslam.errors import InputError
from fdslam.syntax import parse

log = logging.getLogger(__name__)
LIBRARY = f"onnxruntime {onnxruntime.__version__}"  # part of what decides a model's outputs
WEIGHTS = Path(__file__).parent / "weights"  # the shipped models
_FLOATS = {"tensor(float)": np.float32, "tensor(float16)": np.float16}
_HEADER = 8  # bytes of a foreign file that are enough to tell what it is
_FOREIGN = {
    b"PK\x03\x04": "a zip or PyTorch file",
    b"\x80\x02": "a pickle",
    b"\x1f\x8b": "a gzip file",
    b"<": "a web page",
}
_lock = threading.Lock()
_loaded: dict[tuple[str, str, int, str], Model] = {}


@dataclass(frozen=True)
class Model:
    """A model with one image as input. Threads may share it."""

    where: str  # key and path, for messages
    path: Path
    digest: str  # sha256 of the file
    session: onnxruntime.InferenceSession
    provider: str  # where it runs, e.g. "CPUExecutionProvider"
    input: str  # name
    dtype: type  # numpy's, of the input
    planar: bool  # input [1, 3, H, W], or else [1, H, W, 3]
    height: int | None  # of the input, pixels; None: any
    width: int | None
    outputs: tuple[str, ...]  # names
    metadata: dict[str, str]

    def says(self, key: str, choices: tuple[str, ...]) -> str:
        """Return what the metadata say under ``fdslam.KEY``; empty where they say nothing.

        Raises:
            InputError: something that is not among the choices.
        """
        value = self.metadata.get(f"fdslam.{key}", "").strip().lower()
        if value and value not in choices:
            raise InputError(f"{self.where}: its metadata say fdslam.{key}={value}; known are {', '.join(choices)}")
        return value

    def numbers(self, key: str) -> tuple[float, ...]:
        """Return the numbers under ``fdslam.KEY``, as "8 16 32" or "[8, 16, 32]"; none where the metadata say nothing.

        Raises:
            InputError: something that is no number.
        """
        text = self.metadata.get(f"fdslam.{key}", "")
        try:
            found = tuple(float(word) for word in re.split(r"[\s,\[\]()]+", text) if word)
        except ValueError:
            found = (math.nan,)
        if not all(map(math.isfinite, found)):
            raise InputError(f"{self.where}: its metadata say fdslam.{key}={text}; numbers are needed")
        return found

    def names(self) -> tuple[str, ...]:
        """Return the class names in the metadata: a list, or a dict from number to name, as YOLOv5 and later write it.

        Empty where they name none, or in a way that is not understood.
        """
        try:
            names = ast.literal_eval(parse(self.metadata.get("names", "()").strip(), mode="eval"))
        except (ValueError, SyntaxError, MemoryError, RecursionError):
            return ()
        if isinstance(names, dict):
            if sorted(map(str, names)) != sorted(map(str, range(len(names)))):
                return ()
            names = [name for _, name in sorted((int(number), name) for number, name in names.items())]
        return tuple(map(str, names)) if isinstance(names, list | tuple) else ()

    @property
    def identity(self) -> dict[str, str]:
        """What decides the outputs, beside the input."""
        return {"weights": self.digest, "provider": self.provider, "library": LIBRARY}

    def run(self, image: NDArray[np.float32]) -> list[NDArray]:
        """Return every output for one image, float32 [H, W, 3] with channels and values as the model wants them.

        Raises:
            InputError: the model does not run on an image of that size.
        """
        return self.run_part(self.session, image)

    def run_part(self, session: onnxruntime.InferenceSession, image: NDArray[np.float32]) -> list[NDArray]:
        """Return every output of a session of a part of this model that takes the same input; else as ``run``."""
        tensor = image.transpose(2, 0, 1) if self.planar else image
        fed: NDArray = np.ascontiguousarray(tensor[None], dtype=self.dtype)
        try:
            return [np.asarray(value) for value in session.run(None, {self.input: fed})]
        except Exception as error:  # onnxruntime's errors have no base class of their own
            size = f"{image.shape[0]}×{image.shape[1]}"
            raise InputError(f"{self.where}: does not run on one image of {size} pixels ({_line(error)})") from error


def load_model(path: str | Path, key: str, way_out: str, threads: int = 1, device: str = "cpu") -> Model:
    """Return the model in a file.

    Args:
        path: the file.
        key: that names it in the configuration, for messages.
        way_out: what to do where there is no such file, for messages.
        threads: of one inference.
        device: cpu, or cuda where onnxruntime can; where it cannot, a warning says so and the CPU is used.

    Raises:
        InputError: missing, empty, truncated, no ONNX, not the file whose sha256 lies beside it, or not a model with
            one image of three channels as input.
    """
    file = Path(path).expanduser()
    data = _read(file, key, way_out)
    digest = hashlib.sha256(data).hexdigest()
    _check_digest(file, digest, key)
    provider = _provider(device)
    with _lock:  # two threads would make two sessions
        made = f"{key}={file}", digest, threads, provider
        if made not in _loaded:
            _loaded[made] = _model(made[0], file, digest, make_session(made[0], data, threads, provider))
        return _loaded[made]


def _read(file: Path, key: str, way_out: str) -> bytes:
    try:
        data = file.read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(f"{key}={file}: no such file; {way_out}") from None
    except IsADirectoryError:
        raise InputError(f"{key}={file}: a folder; give the .onnx file in it") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{key}: {str(file)!r} cannot be read ({error})") from error
    if not data:
        raise InputError(f"{key}={file}: an empty file; copy or download it again")
    for begin, kind in _FOREIGN.items():
        if data[:_HEADER].startswith(begin):
            raise InputError(f"{key}={file}: {kind} and no ONNX model; export the model to ONNX first")
    return data


def _check_digest(file: Path, digest: str, key: str) -> None:
    """A file NAME.sha256 beside the model, as a download leaves it, says what the model must be."""
    note = file.with_name(file.name + ".sha256")
    if not note.is_file():
        return
    wanted = note.read_text(encoding="utf-8", errors="replace").split()[:1]
    if wanted != [digest]:
        raise InputError(
            f"{key}={file}: its sha256 is {digest}, and {note.name} says {''.join(wanted) or 'nothing'}; the file has "
            f"changed since it came: fetch it again, or remove {note.name} if that was you"
        )


def _provider(device: str) -> str:
    if device.startswith("cuda"):
        if "CUDAExecutionProvider" in onnxruntime.get_available_providers():
            return "CUDAExecutionProvider"
        log.warning("device=%s: this onnxruntime cannot use it, its models run on the CPU", device)
    return "CPUExecutionProvider"


def make_session(where: str, data: bytes, threads: int, provider: str) -> onnxruntime.InferenceSession:
    """Return a session of an ONNX model.

    Args:
        where: names the model in messages.
        data: the model.
        threads: of one inference.
        provider: where it runs.

    Raises:
        InputError: it is not a whole model.
    """
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 4  # what goes wrong is raised too
    options.use_deterministic_compute = True
    try:
        return onnxruntime.InferenceSession(data, options, providers=[provider])
    except Exception as error:
        if "external" in str(error).lower():
            raise InputError(f"{where}: its weights lie in another file; save it as one ONNX file") from error
        raise InputError(f"{where}: not a whole ONNX model ({_line(error)}); copy or download it again") from error


def _line(error: Exception) -> str:
    return " ".join(str(error).rpartition(" : ")[2].split())[:200]


def _model(where: str, path: Path, digest: str, session: onnxruntime.InferenceSession) -> Model:
    inputs = session.get_inputs()
    if len(inputs) != 1:
        names = ", ".join(one.name for one in inputs)
        raise InputError(f"{where}: has {len(inputs)} inputs ({names}); a model with one image as input is needed")
    [one] = inputs
    shape: list[Any] = list(one.shape)
    colours = next((axis for axis in (1, 3) if len(shape) == 4 and shape[axis] == 3), 0)
    if one.type not in _FLOATS or not colours or (isinstance(shape[0], int) and shape[0] != 1):
        raise InputError(
            f"{where}: its input is {one.type} {shape}; float [1, 3, height, width] or [1, height, width, 3] is needed"
        )
    height, width = (size if isinstance(size, int) else None for size in shape[2 if colours == 1 else 1 :][:2])
    return Model(
        where,
        path,
        digest,
        session,
        session.get_providers()[0],
        one.name,
        _FLOATS[one.type],
        colours == 1,
        height,
        width,
        tuple(output.name for output in session.get_outputs()),
        dict(session.get_modelmeta().custom_metadata_map),
    )


def shipped(name: str) -> Path:
    """Return where a shipped model lies."""
    return WEIGHTS / name
