from pathlib import Path

import numpy as np
import pytest

from experiments.table1.campus_as_nclt import utime
from fdslam.data.nclt.annotations import boxes_of, read_annotated
from fdslam.data.nclt.layout import read_session
from fdslam.errors import InputError
from fdslam.types import Frame
from tests.data.nclt.made_up import BOX, MAP, QUERY, annotations, change, made_up


@pytest.fixture
def root(tmp_path):
    return made_up(tmp_path / "nclt")


def read(root):
    session = read_session(root, QUERY, "Cam5")
    annotated = read_annotated(root / "annotations", session, MAP)
    frames = {i: Frame(session.name(i), Path(f"{i}.png"), "", 160, 120) for i in sorted(annotated.images)}
    return dict(zip(frames, boxes_of(annotated, frames), strict=True))


def renamed(root, index, name):
    change(root, lambda coco: coco["images"][index].update(file_name=name))


def test_listed_images_are_the_queries_and_those_without_a_box_distractors(root):
    change(root, lambda coco: coco["images"].pop(5))
    found = read(root)
    assert {i: boxes.tolist() for i, boxes in found.items()} == {0: [], 1: [BOX], 2: [], 3: [BOX], 4: []}
    assert all(boxes.dtype == np.float32 and boxes.shape[1] == 4 for boxes in found.values())


def test_without_a_file_nothing_is_annotated(root):
    assert read_annotated(root / "annotations", read_session(root, MAP, "Cam5"), QUERY) is None


@pytest.mark.parametrize(
    "form",
    ["{d}/lb3/Cam5/{u}.tiff", "{u}.tiff", "{u}.png", "{u}-0123456789abcdef.png", "images/{d}_lb3/{d}/lb3/Cam5/{u}.jpg"],
)
def test_names_with_and_without_folders_and_of_copies(root, form):
    for i in range(6):
        renamed(root, i, form.format(d=QUERY, u=utime(QUERY, i)))
    assert read(root)[3].tolist() == [BOX]


@pytest.mark.parametrize(
    "name",
    [
        f"{MAP}/lb3/Cam5/{utime(QUERY, 1)}.tiff",
        f"{QUERY}/lb3/Cam4/{utime(QUERY, 1)}.tiff",
        f"{MAP}/lb3/Cam5/{utime(MAP, 1)}.tiff",
        f"{utime(QUERY, 6)}.tiff",
        "query/0001.png",
        "1.tiff",
        f"x{utime(QUERY, 1)}.png",
        f"{utime(QUERY, 1)}_1.png",
        "",
        f"{10**40}.tiff",
    ],
)
def test_the_annotations_of_something_else_are_refused(root, name):
    renamed(root, 1, name)
    with pytest.raises(InputError, match=rf"{QUERY}_{MAP}\.json: lists .*, which is no image of {QUERY}") as error:
        read(root)
    assert "\n" not in str(error.value)


def test_boxes_of_the_raw_image_are_told_by_its_size(root):
    change(root, lambda coco: coco["images"][1].update(width=160, height=120))
    with pytest.raises(InputError, match=r"1\.png: is 120×160 pixels, .*says 160×120; .*annotate the upright image"):
        read(root)


def test_a_box_outside_the_upright_image_is_named(root):
    change(root, lambda coco: coco["annotations"][0].update(bbox=[125, 10, 20, 20]))
    with pytest.raises(InputError, match=r"annotation 0 .* lies outside 2012-11-17/lb3/Cam5/"):
        read(root)


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"images": [], "annotations": []}', "\x00"])
def test_a_file_that_annotates_nothing_is_named(root, text):
    annotations(root).write_text(text)
    with pytest.raises(InputError, match=rf"{QUERY}_{MAP}\.json"):
        read(root)
