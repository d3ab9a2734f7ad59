"""The converter, with the data sets that read its result as the oracle."""

import json
import sys

import pytest

from fdslam import convert
from fdslam.config import Folder
from fdslam.data.folder import read_folder
from tests.data.annotations.samples import cvat, labelme, shape
from tests.data.worlds import small_world


def command(*arguments):
    convert.main([str(argument) for argument in arguments])


def boxes(root, path=""):
    return [b.tolist() for b in read_folder(root, Folder(root=str(root), annotations=str(path))).boxes]


def test_coco_to_coco_is_the_same_file(tmp_path):
    root = small_world(tmp_path / "world")
    command(root / "annotations.json", root / "b.json")
    command(root / "b.json", root / "c.json")
    assert (root / "b.json").read_bytes() == (root / "c.json").read_bytes()
    before, after = json.loads((root / "annotations.json").read_text()), json.loads((root / "b.json").read_text())
    assert after["images"] == before["images"]
    assert [(a["image_id"], a["bbox"]) for a in after["annotations"]] == [
        (a["image_id"], a["bbox"]) for a in before["annotations"]
    ]
    assert boxes(root, root / "b.json") == boxes(root, root / "annotations.json")


def test_cvat_to_coco_has_the_same_boxes(tmp_path, capsys):
    root = small_world(tmp_path / "world")
    path = cvat(root / "shapes.xml", '<polygon label="car" points="10.5,20;30,5;12,40.25"/>')
    command(path, root / "b.json")
    assert capsys.readouterr().out == f"{root / 'b.json'}: 3 images, 2 boxes (car 1, person 1)\n"
    assert boxes(root, root / "b.json") == boxes(root, path)
    assert boxes(root, path)[1] == [[10.5, 5, 30, 40.25]]
    files = [image["file_name"] for image in json.loads((root / "b.json").read_text())["images"]]
    assert files == ["query/00.png", "query/01.png", "query/02.png"]


@pytest.mark.parametrize(("folder", "prefix"), [("query", ""), ("notes", "../query/"), ("notes", "")])
def test_labelme_to_coco_has_the_same_boxes(tmp_path, folder, prefix):
    root = small_world(tmp_path / "world")
    for i in (1, 4):
        labelme(root / folder / f"{i:02d}.json", f"{prefix}{i:02d}.png", shape([[50, 40], [53, 44]], "circle"))
    command(root / folder, root / "b.json")
    assert boxes(root, root / "b.json") == boxes(root, root / folder)
    assert boxes(root, root / folder)[4] == [[45, 35, 55, 45]]


def test_labels_of_any_language(tmp_path):
    labelme(tmp_path / "a" / "a.json", "a.png", shape([[1, 2], [3, 4]], label="Baugerüst 足場"))
    command(tmp_path / "a", tmp_path / "b.json")
    command(tmp_path / "b.json", tmp_path / "c.json")
    assert json.loads((tmp_path / "c.json").read_text())["categories"] == [{"id": 0, "name": "Baugerüst 足場"}]


def test_images_need_not_be_there(tmp_path):
    command(cvat(tmp_path / "a.xml"), tmp_path / "out" / "b.json")
    images = json.loads((tmp_path / "out" / "b.json").read_text())["images"]
    assert [image["file_name"] for image in images] == ["00.png", "01.png", "query/02.png"]


@pytest.mark.parametrize(
    ("source", "target", "said"),
    [
        ("a.xml", "there.json", "there.json: is there already; choose another name or add --force"),
        ("a.xml", "b.xml", "b.xml: a COCO file ends in .json"),
        ("gone.xml", "b.json", "gone.xml: not there"),
        ("torn.xml", "b.json", "torn.xml, line 1: no XML"),
        ("a.xml", "there.json/b.json", "cannot write"),
    ],
)
def test_what_cannot_be_done_is_one_line_and_status_2(tmp_path, monkeypatch, capsys, source, target, said):
    cvat(tmp_path / "a.xml")
    (tmp_path / "torn.xml").write_text("<annotations>")
    (tmp_path / "there.json").write_text("{}")
    monkeypatch.setattr(sys, "argv", ["fdslam.convert", str(tmp_path / source), str(tmp_path / target)])
    with pytest.raises(SystemExit) as ended:
        convert.main()
    assert ended.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith("fdslam: ")
    assert said in error
    assert error.count("\n") == 1
    assert (tmp_path / "there.json").read_text() == "{}"
    assert not (tmp_path / "b.json").exists()


def test_force_writes_over(tmp_path):
    (tmp_path / "b.json").write_text("{}")
    command(cvat(tmp_path / "a.xml"), tmp_path / "b.json", "--force")
    assert len(json.loads((tmp_path / "b.json").read_text())["images"]) == 3
