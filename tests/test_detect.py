"""The command for one's own photos, as a user calls it. What the library says of the same images is the oracle."""

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from fdslam import ChangeDetector
from fdslam.data.annotations import read_annotations
from fdslam.data.images import read_image
from fdslam.data.video import video_frames
from fdslam.detect import main, picture_names
from tests.compact.walks import walk
from tests.test_api import SETTINGS

WORDS = [word for setting in SETTINGS for word in ("--set", setting)]


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    base = tmp_path_factory.mktemp("photos")
    root = walk(base / "my <b> phötos", count=10)
    with cv2_video(root / "walk.avi") as video:
        for path in sorted((root / "query").iterdir()):
            for _ in range(5):
                video.write(cv2.cvtColor(read_image(path), cv2.COLOR_RGB2BGR))
    return root


class cv2_video:
    def __init__(self, path):
        self.video = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"FFV1"), 5.0, (160, 120))

    def __enter__(self):
        return self.video

    def __exit__(self, *_):
        self.video.release()


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return tmp_path_factory.mktemp("store")


def command(world, store, out, *words):
    return main(["--map", str(world / "map"), "--store", str(store), "--out", str(out), *WORDS, *words])


def test_photos_get_boxes_pictures_and_a_page(world, store, tmp_path, capsys):
    out = tmp_path / "out"
    assert command(world, store, out, "--detectors", "CC", "--share", "20", "--top", "3", str(world / "query")) == 0
    printed = capsys.readouterr()
    told = json.loads((out / "boxes.json").read_text())
    queries = sorted((world / "query").iterdir())
    detector = ChangeDetector("best", "CC", SETTINGS, store).fit(world / "map")
    for image, path, found in zip(told["images"], queries, detector.detect_all(queries), strict=True):
        assert image["file_name"] == str(path)
        assert (image["height"], image["width"]) == (120, 160)
        assert [h["image"] for h in image["hypotheses"]] == [h.name for h in found.hypotheses]
        mine = [one for one in told["annotations"] if one["image_id"] == image["id"]]
        expected = found.candidates(20, 3)
        assert [one["bbox"] for one in mine] == [
            [*box.xyxy[:2].tolist(), *(box.xyxy[2:] - box.xyxy[:2]).tolist()] for box in expected
        ]
        assert [one["score"] for one in mine] == pytest.approx([box.score for box in expected], abs=1e-6)
        line = next(line for line in printed.out.splitlines() if str(path) in line)
        assert line.split()[-3:] == [
            found.hypotheses[0].name,
            str(len(mine)),
            f"{expected[0].score:.1f}" if mine else "–",
        ]
    assert any(told["annotations"])
    boxes = read_annotations(out / "boxes.json")  # COCO, as our own reader and others' understand it
    assert sum(len(one.annotations) for one in boxes) == len(told["annotations"])
    pictures = sorted((out / "overlays").iterdir())
    assert [path.name for path in pictures] == ["0.jpg", "1.jpg", "2.jpg", "3.jpg"]
    assert all(Image.open(path).size == (160, 120) for path in pictures)
    page = (out / "report.html").read_text()
    assert "<b> ph" not in page
    assert "report.html to look at" in printed.out


def test_json_is_all_that_is_printed_and_a_second_time_says_the_same(world, store, tmp_path, capsys):
    words = ["--detectors", "FD", "--json", "--quiet", str(world / "query" / "1.png")]
    assert command(world, store, tmp_path / "a", *words) == 0
    first = capsys.readouterr()
    assert json.loads(first.out) == json.loads((tmp_path / "a" / "boxes.json").read_text())
    assert first.err == ""
    assert command(world, store, tmp_path / "b", *words) == 0
    assert capsys.readouterr().out == first.out


def test_a_saved_map_serves_without_its_photos(world, store, tmp_path, capsys):
    shutil.copytree(world / "map", tmp_path / "map")
    saved, query = str(tmp_path / "saved"), str(world / "query" / "1.png")
    words = ["--store", str(tmp_path / "store"), "--json", "--quiet"]
    fresh = ["--map", str(tmp_path / "map"), "--detectors", "FD", *WORDS]
    assert main([*fresh, "--save", saved, "--out", str(tmp_path / "a"), *words, query]) == 0
    built = json.loads(capsys.readouterr().out)
    shutil.rmtree(tmp_path / "map")
    shutil.rmtree(tmp_path / "store")
    assert main(["--map", saved, "--out", str(tmp_path / "b"), *words, query]) == 0
    loaded = json.loads(capsys.readouterr().out)
    assert {**loaded, "info": {}} == {**built, "info": {}}
    assert loaded["info"]["detectors"] == "FD"


def test_a_map_alone_can_be_built_and_saved(world, store, tmp_path, capsys):
    assert command(world, store, tmp_path / "out", "--detectors", "FD", "--save", str(tmp_path / "saved")) == 0
    assert capsys.readouterr().out == ""
    assert not (tmp_path / "out").exists()
    assert len(ChangeDetector.load(tmp_path / "saved")) == 10


def test_a_video_is_its_frames_at_the_seconds_asked_for(world, store, tmp_path, capsys):
    words = ["--detectors", "FD", "--json", "--quiet", str(world / "walk.avi")]
    assert command(world, store, tmp_path / "out", *words) == 0
    images = json.loads(capsys.readouterr().out)["images"]
    assert [image["file_name"].rpartition("@")[2] for image in images] == ["0.00s", "1.00s", "2.00s", "3.00s"]
    places = [image["hypotheses"][0]["image"] for image in images]
    detector = ChangeDetector("best", "FD", SETTINGS, store).fit(world / "map")
    assert places == [detector.detect(path).hypotheses[0].name for path in sorted((world / "query").iterdir())]
    assert sorted(path.name for path in (tmp_path / "out" / "overlays").iterdir())[0] == "walk.avi_0.00s.jpg"


def test_pictures_of_images_with_one_name_have_two():
    assert picture_names(["a/1.png", "b/1.png", "c/2.jpg"]) == ["1.jpg", "1-2.jpg", "2.jpg"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--map", "/nowhere", "a.png"], "--map /nowhere: no such folder; give one with images, or a saved map"),
        (["--map", "MAP"], "no QUERY given: name images, folders or videos, or --save DIR"),
        (["--map", "MAP", "--add", "/nowhere", "QUERY"], "--add /nowhere: no such folder; give one with images"),
        (["--map", "MAP", "--add", "EMPTY", "QUERY"], "holds no image"),
        (["--map", "MAP", "/no.png"], "/no.png: no such image, folder or video"),
        (["--map", "MAP", "QUERY", "--share", "0"], "--share 0.0: percent of the cells"),
        (["--map", "MAP", "QUERY", "--top", "-1"], "--top and --every: 0 or more"),
        (["--map", "MAP", "QUERY", "--mode", "good"], "mode=good: no such option, choose one of"),
        (["--map", "MAP", "QUERY", "--set", "obb"], "'obb' is not KEY=VALUE"),
        (["--map", "MAP", "TEXT"], "not an image"),
        (["--map", "MAP", "TORN"], "damaged image"),
        (["--map", "MAP", "VIDEO"], "cannot be read as a video"),
        (["--map", "EMPTY", "QUERY"], "holds no image"),
        (["--map", "MAP", "EMPTY"], "holds no image"),
        (["--map", "MAP", "QUERY", "--out", "TEXT/out"], "TEXT/out: cannot be written".replace("TEXT", "text.png")),
        (["--map", "MAP", "QUERY", "--save", "MAP"], "is there and no saved map; choose a new folder"),
    ],
)
def test_what_the_user_can_mend_is_one_line_and_status_2(words, said, world, store, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.png").write_text("no image")
    (tmp_path / "no.mp4").write_bytes(b"no video")
    (tmp_path / "torn.png").write_bytes((world / "query" / "1.png").read_bytes()[:400])
    names = {
        "MAP": world / "map", "QUERY": world / "query" / "1.png", "EMPTY": tmp_path / "empty",
        "VIDEO": tmp_path / "no.mp4", "TEXT": tmp_path / "text.png", "TORN": tmp_path / "torn.png",
        "TEXT/out": tmp_path / "text.png" / "out",
    }  # fmt: skip
    given = [str(names.get(word, word)) for word in words]
    out = [] if "--out" in words else ["--out", str(tmp_path / "out")]
    before = sorted((world / "map").iterdir())
    assert main([*given, *out, "--store", str(store), "--detectors", "FD", "--quiet", *WORDS]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("fdslam: ")]
    assert len(lines) == 1
    assert said in lines[0]
    assert sorted((world / "map").iterdir()) == before


def test_help_says_how(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--help"])
    assert ended.value.code == 0
    assert "python -m fdslam.detect --map photos/before photos/after" in capsys.readouterr().out


def test_an_interruption_is_status_130(world, store, tmp_path, monkeypatch, capsys):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("fdslam.api.ChangeDetector.outcome", interrupted)
    assert command(world, store, tmp_path / "out", "--detectors", "FD", str(world / "query")) == 130
    assert "interrupted; what is finished is kept" in capsys.readouterr().err


def test_the_overlay_shows_the_image_where_nothing_has_changed():
    from fdslam.report.overlay import overlay

    image = np.full((40, 60, 3), 90, np.uint8)
    places = np.zeros((4, 6), np.float32)
    places[1, 2] = 1
    drawn = cv2.imdecode(np.frombuffer(overlay(image, places, ()), np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1]
    assert np.abs(drawn[30:, 40:].astype(int) - 90).max() < 12
    assert (drawn[13:17, 23:27].mean(axis=(0, 1)) > [180, 180, 100]).all()  # the bright end of the scale


def test_each_picture_has_a_name_of_its_own():
    assert picture_names(["a/1.png", "b/1.png", "c/1-2.png", "d/1.png"]) == ["1.jpg", "1-2.jpg", "1-2-2.jpg", "1-3.jpg"]


def test_names_that_are_no_unicode_or_break_lines_are_written_escaped(world, store, tmp_path, capsys):
    folder = tmp_path / "odd"
    folder.mkdir()
    for name in (b"\xff\xfe.png", b"two\nlines.png"):
        shutil.copy(world / "query" / "1.png", os.fsencode(folder) + b"/" + name)
    words = ["--map", str(folder), "--store", str(store), *WORDS, "--detectors", "FD", str(folder)]
    assert main([*words, "--out", str(tmp_path / "out"), "--save", str(tmp_path / "saved")]) == 0
    printed = capsys.readouterr().out.splitlines()
    names = {str(folder / os.fsdecode(b"\xff\xfe.png")), str(folder / "two\nlines.png")}
    assert any(line.startswith(f"{folder}/two\\nlines.png  ") for line in printed)
    assert any(line.startswith(f"{folder}/\\udcff\\udcfe.png  ") for line in printed)
    told = json.loads((tmp_path / "out" / "boxes.json").read_text(encoding="utf-8"))
    assert {image["file_name"] for image in told["images"]} == names
    assert len(ChangeDetector.load(tmp_path / "saved")) == 2


SAYS = "import sys, fdslam.detect as d; d.detect = lambda asked: 'found'; sys.exit(d.main(['--map', '.', '.']))"


def test_a_reader_that_goes_away_and_a_full_disk_leave_no_traceback():
    def ended(stdout):
        command = [sys.executable, "-c", SAYS]
        return subprocess.run(command, stdout=stdout, stderr=subprocess.PIPE, text=True, check=False)

    reader, writer = os.pipe()
    os.close(reader)
    gone = ended(writer)
    os.close(writer)
    assert (gone.returncode, gone.stderr) == (0, "")
    with open("/dev/full", "wb") as disk:
        full = ended(disk)
    assert full.returncode == 2
    assert full.stderr.startswith("fdslam: No space left on device; ")
    assert full.stderr.count("\n") == 1


def test_what_cannot_be_written_is_said_before_anything_is_made(world, tmp_path, capsys):
    file = tmp_path / "file"
    file.touch()
    for option in ("--out", "--store", "--save"):
        words = ["--map", str(world / "map"), str(world / "query"), option, str(file / "inside")]
        begun = time.monotonic()
        assert main(words) == 2
        assert time.monotonic() - begun < 1
        assert f"{option} {file / 'inside'}: cannot be written; choose another folder" in capsys.readouterr().err


def test_a_video_may_have_any_name(world, tmp_path, monkeypatch):
    shutil.copy(world / "walk.avi", tmp_path / "at 12:30 %d.avi")
    monkeypatch.chdir(tmp_path)
    frames = list(video_frames(Path("at 12:30 %d.avi"), 2.0, tmp_path))
    assert [frame.name for frame in frames] == ["at 12:30 %d.avi@0.00s", "at 12:30 %d.avi@2.00s"]


def test_nothing_is_overwritten(world, store, tmp_path, capsys):
    out = tmp_path / "mine"
    (out / "overlays").mkdir(parents=True)
    (out / "overlays" / "holiday.jpg").write_text("precious")
    assert command(world, store, out, "--detectors", "FD", str(world / "query")) == 2
    assert "mine: is there and not empty; choose a new folder" in capsys.readouterr().err
    assert [path.name for path in out.rglob("*")] == ["overlays", "holiday.jpg"]


def test_a_query_that_cannot_be_read_is_told_before_the_map_is_built(world, store, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("fdslam.api.ChangeDetector.fit", lambda *_: pytest.fail("the map was built"))
    (tmp_path / "text.png").write_text("no image")
    query = str(world / "query" / "1.png")
    for words in ([str(tmp_path / "text.png")], ["--add", str(tmp_path), query]):
        assert command(world, store, tmp_path / "out", *words) == 2
        assert "not an image" in capsys.readouterr().err


def test_a_saved_map_grows_without_its_photos(world, store, tmp_path, capsys):
    photos = sorted((world / "map").iterdir())
    for name, some in (("old", photos[:6]), ("new", photos[6:])):
        (tmp_path / name).mkdir()
        for photo in some:
            shutil.copy(photo, tmp_path / name)
    query, saved = str(world / "query" / "1.png"), str(tmp_path / "saved")
    words = ["--store", str(tmp_path / "store"), "--json", "--quiet"]
    first = ["--map", str(tmp_path / "old"), "--detectors", "CC+EF", *WORDS, "--save", saved]
    assert main([*first, *words]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["images"] == told["annotations"] == []
    assert told["info"]["map_images"] == 6
    shutil.rmtree(tmp_path / "old")
    assert main(["--map", saved, "--add", str(tmp_path / "new"), "--save", saved, *words]) == 0
    assert json.loads(capsys.readouterr().out)["info"]["map_images"] == 10
    assert main(["--map", saved, "--out", str(tmp_path / "a"), *words, query]) == 0
    grown = json.loads(capsys.readouterr().out)
    at_once = ["--map", str(world / "map"), "--detectors", "CC+EF", *WORDS, "--set", "learned=6"]
    assert main([*at_once, "--out", str(tmp_path / "b"), "--store", str(store), "--json", "--quiet", query]) == 0
    expected = json.loads(capsys.readouterr().out)
    assert grown["annotations"] == expected["annotations"] != []
    assert [one["lost"] for one in grown["images"]] == [one["lost"] for one in expected["images"]]
