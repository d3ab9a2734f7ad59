"""The command against a server on this machine that has a made-up NCLT."""

import io
import json
import os
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

from experiments.table1.campus_as_nclt import utime, write_session
from fdslam.config import Nclt
from fdslam.data import load_datasets
from fdslam.fetch import __main__ as command
from fdslam.fetch import download, nclt
from fdslam.fetch.meter import readable
from fdslam.store import Store
from tests.data.nclt.made_up import MAP, QUERY, shots
from tests.fetch.server import free_port, serving

ROOT = Path(__file__).parents[2]
TABLE = "ladybug3_calib/U2D_ALL_1616X1232.tar.gz"


def archive(members):
    data = io.BytesIO()
    with tarfile.open(fileobj=data, mode="w:gz") as tar:
        for name, content in members:
            info = tarfile.TarInfo(name)
            info.size = len(content)
            tar.addfile(info, io.BytesIO(content))
    return data.getvalue()


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    """The files of the bucket, from two made-up sessions, all cameras in one archive."""
    root = tmp_path_factory.mktemp("made")
    files = {"/" + TABLE: archive([(f"U2D_ALL_1616X1232/U2D_Cam{c}_1616X1232.txt", b"table %d" % c) for c in range(6)])}
    for date in (MAP, QUERY):
        write_session(root, date, dict(enumerate(shots(4))))
        images = sorted((root / date / "lb3" / "Cam5").iterdir())
        members = [(f"{date}/lb3/Cam{c}/{p.name}", p.read_bytes() if c else b"up") for p in images for c in (0, 5)]
        files[f"/images/{date}_lb3.tar.gz"] = archive(members)
        poses = f"/ground_truth/groundtruth_{date}.csv"
        files[poses] = (root / poses[1:]).read_bytes()
    return files


@pytest.fixture
def server(published):
    with serving(dict(published)) as running:
        yield running


@pytest.fixture
def run(server, tmp_path, capsys):
    """Run the command; return its status and what it said."""

    def run(*arguments, base=None):
        status = command.main(["nclt", "--to", str(tmp_path / "to"), "--base", base or server.url, *arguments])
        return status, capsys.readouterr().err

    return run


def gets(server):
    return [path for method, path, _ in server.asked if method == "GET"]


def test_what_was_fetched_is_a_data_set(run, tmp_path, published):
    status, said = run("--session", "SU", "--session", QUERY, "--yes")
    assert status == 0
    size = readable(len(published[f"/images/{MAP}_lb3.tar.gz"]))
    for words in (
        size,
        "Open Database License",
        "No checksums are published",
        "4 files, the archive is whole",
        "dataset.root=",
    ):
        assert words in said
    settings = Nclt(root=str(tmp_path / "to"), query="AU", map="SU")
    [data] = load_datasets(settings, Store(tmp_path / "store"), 1)
    assert [len(data.map), len(data.query)] == [4, 4]
    assert not list((tmp_path / "to").rglob("*.partial"))
    assert not list((tmp_path / "to").rglob("*.tar.gz"))
    assert not list((tmp_path / "to").rglob("Cam0"))


def test_a_second_time_there_is_nothing_to_do(run, server):
    run("--session", "SU", "--yes")
    count = len(server.asked)
    status, said = run("--session", "SU", "--yes")
    assert (status, len(server.asked)) == (0, count)
    assert "everything asked for is there" in said


def test_an_image_that_was_lost_is_fetched_again(run, server, tmp_path):
    run("--session", "SU", "--yes", "--keep")
    lost = tmp_path / "to" / MAP / "lb3" / "Cam5" / f"{utime(MAP, 2)}.tiff"
    lost.unlink()
    assert run("--session", "SU", "--yes")[0] == 0
    assert lost.is_file()
    assert gets(server).count(f"/images/{MAP}_lb3.tar.gz") == 1  # the archive was kept


def test_another_camera_of_a_kept_archive(run, server, tmp_path):
    run("--session", "SU", "--yes", "--keep")
    assert run("--session", "SU", "--yes", "--keep", "--camera", "Cam0")[0] == 0
    assert len(list((tmp_path / "to" / MAP / "lb3" / "Cam0").iterdir())) == 4
    assert gets(server).count(f"/images/{MAP}_lb3.tar.gz") == 1


def test_the_table_of_the_undistortion(run, tmp_path):
    assert run("--undistortion", "--yes", "--camera", "Cam3")[0] == 0
    assert (tmp_path / "to" / "U2D_Cam3_1616X1232.txt").read_bytes() == b"table 3"
    assert run("--undistortion", "--yes", "--camera", "Cam3")[1].count("everything asked for is there") == 1


def test_a_connection_that_breaks_on_the_way(run, server, tmp_path):
    server.cuts = [300, 5000, 3000]  # the first is of the poses
    assert run("--session", "SU", "--yes")[0] == 0
    assert len(list((tmp_path / "to" / MAP / "lb3" / "Cam5").iterdir())) == 4


def one_line(status, said):
    assert status == 2
    [line] = [line for line in said.splitlines() if "fdslam: " in line]
    assert "Traceback" not in said
    return line


def test_a_truncated_archive_is_refused_and_never_called_done(run, server, tmp_path):
    path = f"/images/{MAP}_lb3.tar.gz"
    server.files[path] = server.files[path][:-20]
    assert "broken archive" in one_line(*run("--session", "SU", "--yes"))
    assert not (tmp_path / "to" / MAP / "lb3" / "Cam5.fetched").exists()
    assert (tmp_path / "to" / path[1:]).exists()


def test_an_archive_of_something_else_is_refused(run, server):
    server.files[f"/images/{MAP}_lb3.tar.gz"] = archive([(f"{QUERY}/lb3/Cam5/1.tiff", b"x")])
    assert "holds nothing of Cam5" in one_line(*run("--session", "SU", "--yes"))


def test_a_session_that_is_not_there(run):
    assert "groundtruth_2012-02-05.csv: the server says 404" in one_line(*run("--session", "2012-02-05", "--yes"))


def test_offline_it_says_what_to_put_where(run, server, tmp_path, published):
    offline = free_port()
    path = f"ground_truth/groundtruth_{MAP}.csv"
    line = one_line(*run("--session", "SU", "--yes", base=offline))
    assert f"{offline}/{path}" in line
    assert f"put it at {tmp_path / 'to' / path}" in line
    assert "https_proxy" in line
    for name in (path, f"images/{MAP}_lb3.tar.gz"):
        (tmp_path / "to" / name).parent.mkdir(parents=True)
        (tmp_path / "to" / name).write_bytes(published["/" + name])
    status, said = run("--session", "SU", "--yes", base=offline)
    assert status == 0
    assert "put here by hand" in said
    assert server.asked == []


def test_the_licence_must_be_accepted(run, monkeypatch, server):
    answer = io.StringIO("yes\n")
    monkeypatch.setattr(sys, "stdin", answer)
    assert "--yes" in one_line(*run("--session", "SU"))  # no terminal to ask at
    answer.isatty = lambda: True
    assert run("--session", "SU")[0] == 0
    no = io.StringIO("no\n")
    no.isatty = lambda: True
    monkeypatch.setattr(sys, "stdin", no)
    assert "licence was not accepted" in one_line(*run("--session", "AU"))
    assert not any(QUERY in path for path in gets(server))


def test_too_small_a_disk_is_told_before_the_download(run, server, monkeypatch):
    monkeypatch.setattr(download.shutil, "disk_usage", lambda _: type("Usage", (), {"free": 1000}))
    assert "1.0 kB free, about" in one_line(*run("--session", "SU", "--yes"))
    assert gets(server) == []


def test_ctrl_c_keeps_what_has_arrived(run, monkeypatch, tmp_path):
    def stop(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(nclt, "extract", stop)
        status, said = run("--session", "SU", "--yes")
    assert status == 130
    assert "interrupted; what has arrived is kept" in said
    assert (tmp_path / "to" / f"images/{MAP}_lb3.tar.gz").is_file()
    assert run("--session", "SU", "--yes")[0] == 0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "nothing to fetch"),
        (["--session", "2012-1-2"], "--session=2012-1-2: no session"),
        (["--session", "SU", "--base", "file:///etc"], "--base file:///etc: give an address"),
    ],
)
def test_bad_options_are_one_line(run, arguments, said):
    assert said in one_line(*run(*arguments, "--yes"))


@pytest.mark.parametrize(("arguments", "said"), [([], "NAME"), (["nothing"], "nothing"), (["nclt"], "--to"),
                                                 (["nclt", "--to", "x", "--camera", "Cam9"], "Cam9")])  # fmt: skip
def test_a_bad_command_line_is_one_line_and_status_2(arguments, said, capsys):
    with pytest.raises(SystemExit) as ended:
        command.main(arguments)
    assert ended.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith("fdslam: ")
    assert error.count("\n") == 1
    assert said in error


def test_the_command_itself_ends_with_one_line_and_status_2(tmp_path):
    command_line = [sys.executable, "-m", "fdslam.fetch", "nclt", "--session", "SU", "--yes", "--to", "x"]
    done = subprocess.run(
        [*command_line, "--base", free_port()], cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("fdslam: http://127.0.0.1:")
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_the_note_counts_what_was_unpacked(run, tmp_path):
    run("--session", "SU", "--yes")
    note = json.loads((tmp_path / "to" / MAP / "lb3" / "Cam5.fetched").read_text())
    assert (note["archive"], note["files"]) == (f"images/{MAP}_lb3.tar.gz", 4)
