"""Against a server on this machine: whatever happens on the way, the file that arrives is the file that was served."""

import errno
import io

import numpy as np
import pytest

from fdslam.errors import InputError
from fdslam.fetch import download as module
from fdslam.fetch.download import Remote, Unreachable, arrived, check_room, download, partial_path, probe
from tests.fetch.server import free_port, serving

DATA = np.random.default_rng(0).bytes(40_000)


@pytest.fixture
def server():
    with serving({"/a/big": DATA, "/empty": b""}) as running:
        yield running


@pytest.fixture
def target(tmp_path):
    return tmp_path / "to" / "big"


def fetch(server, target):
    download(probe(server.url + "/a/big"), target)
    assert not partial_path(target).exists()
    return target.read_bytes()


def gets(server):
    return [wanted for method, _, wanted in server.asked if method == "GET"]


def test_a_whole_file_and_once_is_enough(server, target):
    assert fetch(server, target) == DATA
    assert fetch(server, target) == DATA
    assert gets(server) == [None]


def test_a_broken_connection_goes_on_where_it_broke(server, target, capsys):
    server.cuts = [15_000, 10_000]
    assert fetch(server, target) == DATA
    assert gets(server) == [None, "bytes=15000-", "bytes=25000-"]
    assert "big.partial: 15.0 kB of 40.0 kB, broke off" in capsys.readouterr().err


def test_what_an_earlier_process_got_is_used(server, target):
    target.parent.mkdir()
    partial_path(target).write_bytes(DATA[:12_345])
    assert arrived(probe(server.url + "/a/big"), target) == 12_345
    assert fetch(server, target) == DATA
    assert gets(server) == ["bytes=12345-"]


def test_a_server_that_cannot_go_on_begins_anew(server, target, capsys):
    server.whole, server.cuts = 99, [15_000]
    assert fetch(server, target) == DATA
    assert "the server cannot go on where it broke off; begun anew" in capsys.readouterr().err


def test_what_was_begun_anew_holds_nothing_of_before(server, target):
    target.parent.mkdir()
    partial_path(target).write_bytes(bytes(15_000))  # of another file, and the server serves a rest only later
    server.whole, server.cuts = 1, [10_000]
    assert fetch(server, target) == DATA
    assert gets(server) == ["bytes=15000-", "bytes=10000-"]


def test_a_connection_that_breaks_often_gets_there(server, target):
    server.cuts = [5000] * 7
    assert fetch(server, target) == DATA


def test_a_partial_file_that_is_too_long_is_begun_anew(server, target):
    target.parent.mkdir()
    partial_path(target).write_bytes(bytes(50_000))
    assert fetch(server, target) == DATA


def test_a_partial_file_that_is_complete_needs_no_connection(server, target):
    target.parent.mkdir()
    partial_path(target).write_bytes(DATA)
    assert fetch(server, target) == DATA
    assert gets(server) == []


def test_a_short_file_under_the_final_name_is_gone_on_with(server, target):
    target.parent.mkdir()
    target.write_bytes(DATA[:7])
    assert fetch(server, target) == DATA
    assert gets(server) == ["bytes=7-"]


def test_an_empty_file(server, target):
    download(probe(server.url + "/empty"), target)
    assert target.read_bytes() == b""


def test_a_busy_server_is_asked_again(server, target):
    server.statuses = [503, 500]
    assert fetch(server, target) == DATA


def test_without_a_byte_it_gives_up_and_keeps_what_it_has(server, target):
    server.cuts = [15_000, 0, 0, 0, 0]
    with pytest.raises(InputError, match=r"broke off 3 times without a byte .*big\.partial keeps what has arrived"):
        fetch(server, target)
    assert partial_path(target).read_bytes() == DATA[:15_000]
    assert not target.exists()
    server.cuts = []
    assert fetch(server, target) == DATA


def test_what_the_server_does_not_have_is_named(server, target):
    with pytest.raises(InputError, match=r"/nothing: the server says 404"):
        probe(server.url + "/nothing")
    with pytest.raises(InputError, match=r"/nothing: the server says 404"):
        download(Remote(server.url + "/nothing", 5), target)


def test_a_rest_of_another_file_is_refused(server, target):
    target.parent.mkdir()
    partial_path(target).write_bytes(DATA[:100])
    remote = probe(server.url + "/a/big")
    server.files["/a/big"] = DATA + b"more"
    with pytest.raises(InputError, match="not with the rest"):
        download(remote, target)


def test_no_server():
    with pytest.raises(Unreachable, match="cannot be reached"):
        probe(free_port() + "/a")
    with pytest.raises(InputError, match="no address"):
        probe("http://[/a")


def test_a_proxy_of_the_environment_is_used(server, target, monkeypatch):
    server.files["http://nclt.invalid/a/big"] = DATA  # a proxy is asked for the whole address
    monkeypatch.setenv("http_proxy", server.url)
    download(probe("http://nclt.invalid/a/big"), target)
    assert target.read_bytes() == DATA


def test_a_full_disk_keeps_what_arrived(server, target, monkeypatch):
    class Full(io.FileIO):
        def write(self, data):
            if self.tell() >= 20_000:
                raise OSError(errno.ENOSPC, "No space left on device")
            return super().write(data)

    opened = module.Path.open
    with monkeypatch.context() as patched:
        patched.setattr(
            module.Path, "open", lambda path, mode: Full(str(path), "r+") if mode == "r+b" else opened(path, mode)
        )
        with pytest.raises(InputError, match=r"big\.partial: cannot be written \(No space left on device\)"):
            fetch(server, target)
    assert partial_path(target).read_bytes() == DATA[:20_000]
    assert fetch(server, target) == DATA
    assert gets(server) == [None, "bytes=20000-"]


def test_an_interruption_keeps_what_arrived(server, target, monkeypatch):
    pieces = []

    def read(response, count):
        if len(pieces) == 5:
            raise KeyboardInterrupt
        pieces.append(response.read(count))
        return pieces[-1]

    with monkeypatch.context() as patched:
        patched.setattr(module, "_read", read)
        with pytest.raises(KeyboardInterrupt):
            fetch(server, target)
    assert partial_path(target).read_bytes() == DATA[:5000]
    assert fetch(server, target) == DATA


def test_too_little_room_is_told_before(tmp_path):
    with pytest.raises(InputError, match=r"free, about 1000000\.0 GB are needed"):
        check_room(tmp_path / "new", 10**15)
    assert not (tmp_path / "new").exists()
    check_room(tmp_path / "new", 1000)
