import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdslam.data.annotations import AnnotatedImage, Annotation
from fdslam.data.annotations.coco import coco_json, read_coco
from fdslam.errors import InputError
from tests.data.annotations.samples import coco, labelme


def test_reads_names_sizes_boxes_and_labels(tmp_path):
    path = coco(tmp_path / "a.json")
    first, second = read_coco(path)
    assert (first.file, first.size, second.file, second.size) == ("query/01.png", (160, 120), "query/02.png", None)
    assert [a.label for a in first.annotations] == ["car", "person"]
    assert first.annotations[0].xyxy == pytest.approx((40.1, 60.3, 80.3, 101))
    assert first.annotations[1].where == f"{path}: annotation 2"


def test_without_categories_a_label_is_its_number(tmp_path):
    [first, _] = read_coco(coco(tmp_path / "a.json", categories=[]))
    assert [a.label for a in first.annotations] == ["3", "2"]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"images": [{"id": 4, "file_name": "a"}] * 2}, "two images have the id 4"),
        ({"images": []}, "annotation 1 is of image 4, which is not among its images"),
        ({"annotations": [{"id": 5, "image_id": 4}]}, "annotation 5 has the bbox None"),
        ({"annotations": [{"image_id": 4, "bbox": [1, 2, 0, 4]}]}, "annotation number 1 has the bbox"),
        ({"annotations": [{"id": 5, "image_id": 4, "bbox": [1, 2, "3", 4]}]}, "annotation 5 has the bbox"),
        ({"annotations": {"id": 5}}, "not COCO annotations"),
        (
            {"images": [{"id": 4, "file_name": "a", "width": "160", "height": 1}], "annotations": []},
            "the width is '160'",
        ),
        ({"categories": [{"name": "car"}]}, "not COCO annotations"),
        ({"categories": 3}, "not COCO annotations"),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path, changes, said):
    with pytest.raises(InputError, match=rf"a\.json: .*{said}"):
        read_coco(coco(tmp_path / "a.json", **changes))


def test_a_syntax_error_is_named_with_its_line_and_a_labelme_file_as_such(tmp_path):
    path = tmp_path / "a.json"
    path.write_text('{"images": [],\n "annotations": [}')
    with pytest.raises(InputError, match=r"a\.json, line 2, column 18: no JSON"):
        read_coco(path)
    with pytest.raises(InputError, match=r"a LabelMe file; give the folder that holds it"):
        read_coco(labelme(path, "a.png"))


def test_what_is_written_is_read_back_and_written_the_same(tmp_path):
    images = read_coco(coco(tmp_path / "a.json"))
    (tmp_path / "b.json").write_bytes(coco_json(images))
    again = read_coco(tmp_path / "b.json")
    assert [(i.file, i.size, [(a.xyxy, a.label) for a in i.annotations]) for i in again] == [
        (i.file, i.size, [(a.xyxy, a.label) for a in i.annotations]) for i in images
    ]
    assert coco_json(again) == coco_json(images)


edge = st.floats(-1e4, 1e4).map(lambda v: round(v, 4))
extent = st.floats(0.01, 1e4).map(lambda v: round(v, 4))


@given(st.lists(st.tuples(edge, edge, extent, extent, st.text(max_size=8)), max_size=4))
def test_any_box_survives(tmp_path_factory, boxes):
    path = tmp_path_factory.mktemp("coco") / "a.json"
    found = tuple(Annotation((x, y, x + w, y + h), label, "") for x, y, w, h, label in boxes)
    path.write_bytes(coco_json([AnnotatedImage("a.png", Path(), None, found, "")]))
    [image] = read_coco(path)
    assert [a.label for a in image.annotations] == [label for *_, label in boxes]
    assert json.loads(path.read_bytes())["annotations"] == [] or [
        a["bbox"] for a in json.loads(path.read_bytes())["annotations"]
    ] == [[x, y, w, h] for x, y, w, h, _ in boxes]
    second = coco_json([image])
    path.write_bytes(second)
    assert coco_json(read_coco(path)) == second


def test_labels_keep_the_order_they_are_given_in():
    image = AnnotatedImage("a.png", Path(), (3, 4), (Annotation((0, 0, 1, 2), "b", ""),), "")
    content = json.loads(coco_json([image], ["c", "b"]))
    assert content["categories"] == [{"id": 0, "name": "c"}, {"id": 1, "name": "b"}]
    assert content["annotations"] == [
        {"id": 0, "image_id": 0, "category_id": 1, "bbox": [0, 0, 1, 2], "area": 2, "iscrowd": 0}
    ]
