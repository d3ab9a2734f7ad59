import os

import pytest

from fdslam.data import ledger
from fdslam.data.ledger import remembered_digest
from fdslam.store import Store, sha256_file


@pytest.fixture
def hashed(monkeypatch):
    """Names of the files that were hashed, with files that settle at once."""
    names = []
    monkeypatch.setattr(ledger, "SETTLED", -1)
    monkeypatch.setattr(ledger, "sha256_file", lambda path: (names.append(path.name), sha256_file(path))[1])
    return names


def test_a_file_as_it_was_is_hashed_once(tmp_path, hashed):
    path, store = tmp_path / "a", Store(tmp_path / "store")
    path.write_bytes(b"one")
    assert {remembered_digest(path, store) for _ in range(3)} == {sha256_file(path)}
    assert hashed == ["a"]


def test_a_file_that_changed_is_hashed_again_even_with_its_old_date(tmp_path, hashed):
    path, store = tmp_path / "a", Store(tmp_path / "store")
    path.write_bytes(b"one")
    before = path.stat()
    remembered_digest(path, store)
    path.write_bytes(b"two")
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert remembered_digest(path, store) == sha256_file(path)
    assert hashed == ["a", "a"]


def test_a_file_that_changed_a_moment_ago_is_not_remembered(tmp_path):
    path, store = tmp_path / "a", Store(tmp_path / "store")
    path.write_bytes(b"one")
    remembered_digest(path, store)
    assert list((tmp_path / "store").rglob("*")) == []


def test_two_files_of_one_size_are_told_apart(tmp_path, hashed):
    store = Store(tmp_path / "store")
    for name in ("a", "b"):
        (tmp_path / name).write_bytes(name.encode())
    assert remembered_digest(tmp_path / "a", store) != remembered_digest(tmp_path / "b", store)
