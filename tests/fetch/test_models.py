"""Against a server on this machine: a model is trusted only when its sha256 was checked or confirmed."""

import hashlib
import io
import sys
from dataclasses import replace

import pooch
import pytest

from fdslam.config import Yolo as Settings
from fdslam.errors import InputError
from fdslam.fetch import FETCHERS, download, models
from fdslam.fetch import __main__ as command
from fdslam.fetch.registry import MODELS
from fdslam.obb.yolo import Yolo
from tests.fetch.server import free_port, serving
from tests.onnx_models import colour_finder

FILE = "yolox_nano.onnx"
CHECKPOINT = "deeplabv3plus-cityscapes"


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return colour_finder(tmp_path_factory.mktemp("served") / FILE, "yolox").read_bytes()


@pytest.fixture
def server(model):
    with serving({f"/m/{FILE}": model}) as running:
        yield running


@pytest.fixture
def run(server, tmp_path, capsys):
    """Run the command; return its status and what it said."""

    def run(*arguments, base=None, name="yolox-nano"):
        to = [] if "--to" in arguments else ["--to", str(tmp_path / "to")]
        status = command.main([name, *to, "--base", base or server.url + "/m", *arguments])
        return status, capsys.readouterr().err

    return run


@pytest.fixture
def target(tmp_path):
    return tmp_path / "to" / FILE


def answer(monkeypatch, text, terminal=True):
    stdin = io.StringIO(text)
    stdin.isatty = lambda: terminal
    monkeypatch.setattr(sys, "stdin", stdin)


def one_line(status, said):
    assert status == 2
    [line] = [line for line in said.splitlines() if "fdslam: " in line]
    assert "Traceback" not in said
    return line


def left(target):
    return sorted(path.name for path in target.parent.iterdir()) if target.parent.is_dir() else []


def sha(data):
    return hashlib.sha256(data).hexdigest()


def gets(server):
    return [wanted for method, _, wanted in server.asked if method == "GET"]


def test_a_good_file_is_shown_confirmed_recorded_and_runs(run, server, target, model, monkeypatch):
    answer(monkeypatch, "yes\nyes\n")
    status, said = run()
    assert status == 0
    for words in ("Apache-2.0", "unverified", f"{server.url}/m/{FILE}", str(target), f"sha256 of {target}.unconfirmed",
                  sha(model), MODELS["yolox-nano"].page, f"obb.yolo.weights={target}"):  # fmt: skip
        assert words in said
    assert said.index("Terms:") < said.index("Accept the terms") < said.index("sha256 of")
    assert target.read_bytes() == model
    assert target.with_name(FILE + ".sha256").read_text() == f"{sha(model)}  {FILE}\n"
    assert left(target) == [FILE, FILE + ".sha256"]
    assert Yolo(Settings(weights=str(target))).head.layout == "yolox"
    target.write_bytes(model + b"\0")
    with pytest.raises(InputError, match="has changed since it came"):
        Yolo(Settings(weights=str(target)))


def test_a_second_time_only_the_file_is_checked(run, server, target, model):
    assert run("--yes")[0] == 0
    count = len(server.asked)
    status, said = run()  # nobody is asked: the recorded sha256 is known
    assert (status, len(server.asked)) == (0, count)
    assert "is there" in said
    assert "as expected" in said
    target.write_bytes(model[:-1])
    assert f"must be {sha(model)}; remove it" in one_line(*run("--yes"))


def test_the_terms_must_be_accepted_before_anything_comes(run, server, target, monkeypatch):
    assert "--yes" in one_line(*run())  # no terminal to ask at
    answer(monkeypatch, "no\n")
    assert "terms were not accepted" in one_line(*run())
    assert gets(server) == []
    assert left(target) == []


def test_what_is_not_confirmed_is_not_used_and_not_fetched_twice(run, server, target, model, monkeypatch):
    answer(monkeypatch, "yes\nno\n")
    assert "not confirmed, so it is not used" in one_line(*run())
    assert left(target) == [FILE + ".unconfirmed"]
    assert "must be 0000" in one_line(*run("--sha256", "0" * 64))
    assert run("--sha256", sha(model).upper())[0] == 0
    assert gets(server) == [None]
    assert left(target) == [FILE, FILE + ".sha256"]


def test_a_tampered_file_is_thrown_away_where_the_sha256_is_known(run, server, target, model):
    server.files[f"/m/{FILE}"] = model[:-1] + bytes([model[-1] ^ 1])
    assert f"does not have the sha256 {sha(model)}" in one_line(*run("--yes", "--sha256", sha(model)))
    assert left(target) == []
    server.files[f"/m/{FILE}"] = model
    assert run("--yes", "--sha256", sha(model))[0] == 0


def test_a_registered_sha256_is_held_against_the_file(run, server, target, model, monkeypatch):
    monkeypatch.setitem(MODELS, "yolox-nano", replace(MODELS["yolox-nano"], sha256=sha(model)))
    status, said = run("--yes")
    assert status == 0
    assert "its sha256 is known and is checked" in said
    assert "unverified" not in said
    assert "by one account" in one_line(*run("--yes", "--sha256", "0" * 64))
    target.unlink()
    server.files[f"/m/{FILE}"] = b"something else"
    assert "does not have the sha256" in one_line(*run("--yes"))
    assert not target.exists()


def test_a_truncated_file_is_no_model(run, server, target, model):
    server.files[f"/m/{FILE}"] = model[:-60]
    assert "not a whole ONNX model" in one_line(*run("--yes"))
    assert left(target) == []
    server.files[f"/m/{FILE}"] = model
    assert run("--yes")[0] == 0


def test_the_page_of_a_proxy_is_no_model(run, server, target):
    server.files[f"/m/{FILE}"] = b"<html>log in first</html>"
    line = one_line(*run("--yes"))
    assert "a web page and no ONNX model" in line
    assert "thrown away" in line
    assert left(target) == []


def test_a_connection_that_breaks_goes_on_where_it_broke(run, server, target, model):
    assert len(model) > 2200
    server.cuts = [1500, 700]
    assert run("--yes")[0] == 0
    assert gets(server) == [None, "bytes=1500-", "bytes=2200-"]
    assert target.read_bytes() == model


def test_a_later_command_goes_on_where_an_earlier_one_broke(run, server, target, model):
    server.cuts = [1500, 0, 0, 0]
    assert "keeps what has arrived" in one_line(*run("--yes"))
    assert left(target) == [FILE + ".arriving.partial"]
    server.cuts = []
    assert run("--yes")[0] == 0
    assert gets(server)[-1] == "bytes=1500-"
    assert target.read_bytes() == model
    assert left(target) == [FILE, FILE + ".sha256"]


def test_offline_it_says_what_to_put_where_and_takes_it(run, target, model):
    offline = free_port()
    line = one_line(*run("--yes", base=offline))
    for words in (f"{offline}/{FILE}", "https_proxy", f"put it at {target}"):
        assert words in line
    target.parent.mkdir(exist_ok=True)
    target.write_bytes(model)
    assert "not confirmed" in one_line(*run(base=offline))
    assert run("--yes", base=offline)[0] == 0
    assert target.with_name(FILE + ".sha256").is_file()


def test_a_proxy_of_the_environment_is_used(run, server, target, model, monkeypatch):
    server.files[f"http://models.invalid/m/{FILE}"] = model  # a proxy is asked for the whole address
    monkeypatch.setenv("http_proxy", server.url)
    assert run("--yes", base="http://models.invalid/m")[0] == 0
    assert target.read_bytes() == model


def test_a_checkpoint_is_checked_by_what_its_name_says_and_never_opened(run, server, tmp_path, monkeypatch):
    data = b"\x80\x02 what a checkpoint begins with"
    file = MODELS[CHECKPOINT].url.rpartition("/")[2]
    server.files[f"/m/{file}"] = data
    assert "must begin with d222ffcd" in one_line(*run("--yes", name=CHECKPOINT))
    assert left(tmp_path / "to" / file) == []
    monkeypatch.setitem(MODELS, CHECKPOINT, replace(MODELS[CHECKPOINT], begins=sha(data)[:8]))
    status, said = run("--yes", name=CHECKPOINT)
    assert status == 0
    assert "convert it to ONNX" in said
    assert (tmp_path / "to" / file).read_bytes() == data


def test_too_small_a_disk_is_told_before(run, server, monkeypatch):
    monkeypatch.setattr(download.shutil, "disk_usage", lambda _: type("Usage", (), {"free": 10}))
    assert "10 B free, about" in one_line(*run("--yes"))
    assert gets(server) == []


def test_a_file_where_the_folder_should_be(run, tmp_path):
    (tmp_path / "taken").write_text("")
    assert "taken" in one_line(*run("--yes", "--to", str(tmp_path / "taken")))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--sha256", "abc"], "--sha256 abc: give the 64 digits"),
        (["--base", "ftp://x"], "--base ftp://x: give an address"),
    ],
)
def test_bad_options_are_one_line(arguments, said, run):
    assert said in one_line(*run("--yes", *arguments))


def test_the_registry_lists_what_was_asked_for_and_no_hash_that_nobody_verified():
    assert {"yolox-nano", "yolox-tiny", "yolox-s"} <= MODELS.keys()
    assert any("Cityscapes" in one.summary and "DeepLabV3+" in one.summary for one in MODELS.values())
    for one in MODELS.values():
        assert one.sha256 == ""
        assert one.url.startswith("https://")
        assert one.licence
        assert one.begins in one.url
    assert MODELS.keys() < FETCHERS.keys()


def test_the_folder_is_the_user_s_cache_unless_told(capsys):
    with pytest.raises(SystemExit):
        command.main(["yolox-nano", "--help"])
    assert pooch.os_cache("fdslam").name in capsys.readouterr().out
    assert models._SHA256.fullmatch("0" * 64)
