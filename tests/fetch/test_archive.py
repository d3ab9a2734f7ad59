"""Archives that are whole, torn, and made to do harm."""

import gzip
import io
import tarfile

import pytest

from fdslam.errors import InputError
from fdslam.fetch import archive as module
from fdslam.fetch.archive import extract


def packed(path, members, **options):
    """Write a .tar.gz of (name, bytes or {"type": …}) pairs."""
    with tarfile.open(path, "w:gz", **options) as tar:
        for name, content in members:
            info = tarfile.TarInfo(name)
            if isinstance(content, bytes):
                info.size = len(content)
                tar.addfile(info, io.BytesIO(content))
            else:
                info.type, info.linkname = content["type"], "/etc/passwd"
                tar.addfile(info)
    return path


MEMBERS = [(f"d/Cam{c}/{i}.tiff", bytes([c, i]) * 3000) for i in range(4) for c in range(2)]


def unpack(archive, to):
    return extract(archive, lambda name: to / name.split("/")[-1] if "/Cam1/" in name else None)


@pytest.fixture
def archive(tmp_path):
    return packed(tmp_path / "a.tar.gz", MEMBERS)


def test_only_what_is_wanted_is_written(archive, tmp_path):
    assert unpack(archive, tmp_path / "to") == 4
    assert {p.name: p.read_bytes() for p in (tmp_path / "to").iterdir()} == {
        f"{i}.tiff": bytes([1, i]) * 3000 for i in range(4)
    }


def test_what_is_there_is_left_and_what_is_torn_made_again(archive, tmp_path):
    (tmp_path / "to").mkdir()
    (tmp_path / "to" / "0.tiff").write_bytes(bytes([1, 0]) * 3000)
    (tmp_path / "to" / "1.tiff").write_bytes(b"torn")
    before = (tmp_path / "to" / "0.tiff").stat().st_mtime_ns
    assert unpack(archive, tmp_path / "to") == 4
    assert (tmp_path / "to" / "0.tiff").stat().st_mtime_ns == before
    assert (tmp_path / "to" / "1.tiff").read_bytes() == bytes([1, 1]) * 3000


@pytest.mark.parametrize("cut", [1, 4, 9, 100, 0.5, 0.95])
def test_a_truncated_archive_is_named(archive, tmp_path, cut):
    data = archive.read_bytes()
    archive.write_bytes(data[: int(len(data) * cut)] if cut < 1 else data[:-cut])
    with pytest.raises(InputError, match=r"a\.tar\.gz: broken archive"):
        unpack(archive, tmp_path / "to")


def test_every_flipped_byte_is_noticed_or_harmless(archive, tmp_path):
    """gzip's checksum covers the content; of its header only what does not matter (time, system) may change."""
    data = archive.read_bytes()
    for at in range(0, len(data), 7):
        archive.write_bytes(data[:at] + bytes([data[at] ^ 0x55]) + data[at + 1 :])
        if at >= 10 + len("a.tar") + 1:
            with pytest.raises(InputError, match="broken archive"):
                unpack(archive, tmp_path / str(at))


def test_a_header_that_is_damaged_in_the_middle_does_not_end_it_early(tmp_path):
    raw = bytearray(gzip.decompress(packed(tmp_path / "a.tar.gz", MEMBERS).read_bytes()))
    raw[(512 + 6144) * 3 + 148 : (512 + 6144) * 3 + 156] = b"garbage!"  # the checksum of the fourth header
    (tmp_path / "a.tar.gz").write_bytes(gzip.compress(bytes(raw)))
    with pytest.raises(InputError, match="broken archive"):
        unpack(tmp_path / "a.tar.gz", tmp_path / "to")


@pytest.mark.parametrize("content", [b"", b"not a gzip", b"<html>Access denied</html>"])
def test_what_is_no_archive_is_named(tmp_path, content):
    (tmp_path / "a.tar.gz").write_bytes(content)
    with pytest.raises(InputError, match=r"a\.tar\.gz"):
        unpack(tmp_path / "a.tar.gz", tmp_path / "to")


@pytest.mark.parametrize(
    "name", ["../Cam1/1.tiff", "/tmp/Cam1/1.tiff", "d/Cam1/../../../1.tiff", "d\\Cam1\\1.tiff", "../x"]
)
def test_a_member_that_points_out_of_the_folder_is_refused(tmp_path, name):
    with pytest.raises(InputError, match="points out of it"):
        unpack(packed(tmp_path / "a.tar.gz", [*MEMBERS, (name, b"x")]), tmp_path / "to")


@pytest.mark.parametrize("kind", [tarfile.SYMTYPE, tarfile.LNKTYPE, tarfile.DIRTYPE, tarfile.CHRTYPE, tarfile.FIFOTYPE])
def test_links_and_devices_are_never_made(tmp_path, kind):
    with pytest.raises(InputError, match="is no plain file"):
        unpack(packed(tmp_path / "a.tar.gz", [("d/Cam1/1.tiff", {"type": kind})]), tmp_path / "to")
    assert unpack(packed(tmp_path / "b.tar.gz", [("d/Cam0/1.tiff", {"type": kind}), *MEMBERS]), tmp_path / "to") == 4


def test_a_file_too_large_is_refused(archive, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "MOST_BYTES", 5999)
    with pytest.raises(InputError, match="no plain file of a sane size"):
        unpack(archive, tmp_path / "to")


def test_a_disk_that_refuses_is_named(archive, tmp_path):
    (tmp_path / "to").write_bytes(b"a file where a folder is needed")
    with pytest.raises(InputError, match="cannot be written"):
        unpack(archive, tmp_path / "to")
