import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from fdslam import store as store_module
from fdslam.errors import InputError
from fdslam.store import Stage, Store, code_version, digest, write_atomically

STAGE = Stage("thing", ("fdslam.localization",))


def arrays():
    return {
        "a": np.arange(6, dtype=np.int32).reshape(2, 3),
        "empty": np.zeros((0, 4), np.float32),
        "scalar": np.array(3),
    }


def test_what_is_put_is_got(tmp_path):
    store = Store(tmp_path)
    assert store.get(STAGE, "0" * 64) is None
    store.put(STAGE, "0" * 64, arrays())
    found = store.get(STAGE, "0" * 64)
    assert found.keys() == arrays().keys()
    for name, array in arrays().items():
        assert found[name].dtype == array.dtype
        assert found[name].shape == array.shape
        assert np.array_equal(found[name], array)


@pytest.mark.parametrize("where", ["cut", "flip", "empty"])
def test_a_damaged_artefact_is_removed_and_not_trusted(tmp_path, where):
    store = Store(tmp_path)
    store.put(STAGE, "1" * 64, arrays())
    path = store.path(STAGE, "1" * 64)
    data = bytearray(path.read_bytes())
    if where == "flip":
        data[-1] ^= 1
    path.write_bytes({"cut": data[:-5], "flip": data, "empty": b""}[where])
    assert not store.has(STAGE, "1" * 64)
    assert not path.exists()


def test_the_key_hangs_on_everything_that_decides_the_result():
    key = STAGE.key({"k": 1}, ["a", "b"])
    assert key == STAGE.key({"k": 1}, ["a", "b"])
    others = [
        STAGE.key({"k": 2}, ["a", "b"]),
        STAGE.key({"k": 1}, ["b", "a"]),
        STAGE.key({"k": 1}, ["ab"]),
        Stage("other", ("fdslam.localization",)).key({"k": 1}, ["a", "b"]),
        Stage("thing", ("fdslam.bow.index",)).key({"k": 1}, ["a", "b"]),
        Stage("thing", ("fdslam.localization",), ("numpy",)).key({"k": 1}, ["a", "b"]),
    ]
    assert len({key, *others}) == len(others) + 1
    assert digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1})


def test_the_code_version_follows_imports(tmp_path, monkeypatch):
    package = tmp_path / "fdslam"
    (package / "deep").mkdir(parents=True)
    (package / "deep" / "__init__.py").write_text("")
    (package / "top.py").write_text("from fdslam.deep import below\n")
    (package / "deep" / "below.py").write_text("x = 1\n")
    (package / "aside.py").write_text("y = 1\n")
    monkeypatch.setattr(store_module, "PACKAGE", package)

    def version():
        code_version.cache_clear()
        return code_version("fdslam.top")

    try:
        first = version()
        (package / "aside.py").write_text("y = 2\n")
        assert version() == first
        (package / "deep" / "below.py").write_text("x = 2\n")
        assert version() != first
    finally:
        code_version.cache_clear()


def test_a_failed_write_leaves_the_old_file_and_says_so(tmp_path, monkeypatch):
    path = tmp_path / "file"
    write_atomically(path, b"old")

    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match=r"cannot write .*No space left"):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write"):
        write_atomically(tmp_path / "file" / "inside", b"x")


KILLED = """
import sys, os, signal
from fdslam.store import write_atomically
from pathlib import Path
def stop(_): os.kill(os.getpid(), signal.SIGKILL)
os.fsync = stop
write_atomically(Path(sys.argv[1]), b"new" * 1000)
"""


def test_a_kill_during_a_write_leaves_the_old_file(tmp_path):
    path = tmp_path / "file"
    write_atomically(path, b"old")
    done = subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False)
    assert done.returncode == -signal.SIGKILL
    assert path.read_bytes() == b"old"


def test_a_file_may_be_read_by_whom_the_user_lets(tmp_path):
    for mask in (0o022, 0o077):
        before = os.umask(mask)
        try:
            write_atomically(tmp_path / "file", b"text")
        finally:
            os.umask(before)
        assert (tmp_path / "file").stat().st_mode & 0o777 == 0o666 & ~mask
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
