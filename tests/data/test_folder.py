import json

import numpy as np
import pytest
from PIL import Image

from fdslam.config import Folder
from fdslam.data.folder import read_folder
from fdslam.errors import InputError
from tests.data.annotations.samples import BOX, cvat, labelme, shape
from tests.data.worlds import small_world, texture, write_csv


@pytest.fixture
def world(tmp_path):
    return small_world(tmp_path / "world")


def read(root):
    return read_folder(root, Folder())


def change(root, edit):
    coco = json.loads((root / "annotations.json").read_text())
    edit(coco)
    (root / "annotations.json").write_text(json.dumps(coco))


def test_reads_everything(world):
    data = read(world)
    assert data.name == "world"
    assert [f.name for f in data.map] == [f"map/{i:02d}.png" for i in range(6)]
    assert (data.query[0].height, data.query[0].width) == (120, 160)
    assert [len(b) for b in data.boxes] == [0, 1, 0, 1, 0, 0]
    assert data.boxes[1].tolist() == [[40, 60, 80, 100]]
    assert [r.tolist() for r in data.relevant] == [[i] for i in range(6)]
    assert all(path.name == f"{i:02d}.png" for i, path in enumerate(data.labels))
    assert data.poses is None
    assert data.times.tolist() == [0, 10, 20, 30, 40, 50]


def test_bare_folders_of_images_are_enough(tmp_path):
    for folder in ("map", "query"):
        (tmp_path / folder).mkdir()
        Image.fromarray(texture(0)).save(tmp_path / folder / "b.png")
        Image.fromarray(texture(1)).save(tmp_path / folder / "a.jpg")
        (tmp_path / folder / "notes.txt").write_text("not an image")
    data = read(tmp_path)
    assert [f.name for f in data.map] == ["map/a.jpg", "map/b.png"]
    assert (data.boxes, data.relevant, data.labels, data.poses) == (None, None, None, None)


def test_places_by_index_are_nearest_first_and_stay_on_their_drive(world):
    write_csv(
        world / "map.csv",
        ["map_file", "drive", "index"],
        [[f"map/{i:02d}.png", "d" if i < 5 else "e", [7, 5, 1, 9, 2, 5][i]] for i in range(6)],
    )
    write_csv(world / "pairs.csv", ["query_file", "drive", "query_index"], [["query/00.png", "d", 4]])
    data = read(world)
    assert data.relevant[0].tolist() == [1, 4, 0, 2]  # at 1, 2, 3, 3; not map 3 at 5, not map 5 of drive e
    assert len(data.query) == 1


def test_places_by_pose_use_distance_and_heading(world):
    header = ["map_file", "drive", "index", "x", "y", "heading"]
    poses = [(0, 0, 0), (3, 0, 3.1), (4.9, 0, 0), (0, 5.3, 0), (1, 1, -0.7), (0, 1, 6.2)]
    write_csv(world / "map.csv", header, [[f"map/{i:02d}.png", "d", i, *p] for i, p in enumerate(poses)])
    write_csv(
        world / "pairs.csv",
        ["query_file", "drive", "query_index", "x", "y", "heading"],
        [["query/00.png", "d", 99, 0, 0.2, 0]],
    )
    data = read(world)
    assert data.relevant[0].tolist() == [0, 5, 4, 2]
    assert data.poses.shape == (6, 3)


def test_a_box_that_reaches_over_the_border_is_cut(world):
    change(world, lambda coco: coco["annotations"][0].update(bbox=[150, -5, 30, 20]))
    assert read(world).boxes[1].tolist() == [[150, 0, 160, 15]]


@pytest.mark.parametrize(
    "bbox", [[200, 10, 5, 5], [-20, 0, 20, 10], [1, 1, 0, 5], [1, 1, 5], ["a", 1, 2, 3], None, [10**400, 1, 2, 3]]
)
def test_a_bad_box_is_named(world, bbox):
    change(world, lambda coco: coco["annotations"][1].update(bbox=bbox))
    with pytest.raises(InputError, match=r"annotations\.json: annotation 1"):
        read(world)


def test_nan_in_a_box_is_named(world):
    text = (world / "annotations.json").read_text().replace("[40, 60, 40, 40]", "[NaN, 60, 40, 40]", 1)
    (world / "annotations.json").write_text(text)
    with pytest.raises(InputError, match="annotation 0"):
        read(world)


def test_an_image_of_another_size_than_its_annotation_says_is_named(world):
    change(world, lambda coco: coco["images"][2].update(width=161))
    with pytest.raises(
        InputError, match=r"query/02\.png: is 160×120 pixels, .*annotations\.json: image 2 says 161×120"
    ):
        read(world)


def test_names_without_their_folder_are_understood(world):
    expected = read(world)
    for name in ("map.csv", "pairs.csv", "annotations.json"):
        text = (world / name).read_text()
        (world / name).write_text(text.replace("query/", "").replace("map/", ""))
    assert read(world).map == expected.map
    assert [b.tolist() for b in read(world).boxes] == [b.tolist() for b in expected.boxes]


def test_what_is_left_out_is_said(world, caplog):
    write_csv(world / "pairs.csv", ["query_file", "drive", "query_index"], [["query/01.png", "d", 10]])
    read(world)
    assert "query: 5 of 6 images are not listed and left out" in caplog.text
    for name in ("map.csv", "pairs.csv", "annotations.json"):
        (world / name).unlink()
    (world / "query" / "01.png").rename(world / "query" / "01.txt")
    assert len(read(world).query) == 5
    assert "query: 1 left out, no images by their suffix: 01.txt" in caplog.text


def test_annotations_of_another_data_set_are_refused(world):
    change(world, lambda coco: coco["annotations"][0].update(image_id=77))
    with pytest.raises(InputError, match="annotation 0 is of image 77"):
        read(world)


def test_a_misspelt_image_does_not_become_an_unchanged_one(world):
    change(world, lambda coco: coco["images"][1].update(file_name="query/1.png"))
    with pytest.raises(InputError, match=r"annotation 0 is of 'query/1\.png', which is no image here"):
        read(world)
    change(world, lambda coco: coco["images"][1].update(file_name="map/01.png"))  # an image, but no query
    assert [len(b) for b in read(world).boxes] == [0, 0, 0, 1, 0, 0]


@pytest.mark.parametrize("text", ["", "{}", "[1, 2]", '{"images": 3, "annotations": []}', "not json", "[" * 100_000])
def test_a_file_that_is_no_annotation_is_named(world, text):
    (world / "annotations.json").write_text(text)
    with pytest.raises(InputError, match=r"annotations\.json"):
        read(world)


@pytest.mark.parametrize("value", ["nan", "", "inf", "north", "1e308"])
def test_a_number_that_is_none_is_named_with_its_line(world, value):
    rows = [[f"map/{i:02d}.png", "d", value if i == 2 else i] for i in range(6)]
    write_csv(world / "map.csv", ["map_file", "drive", "index"], rows)
    with pytest.raises(InputError, match=r"map\.csv, line 4: index"):
        read(world)


def test_missing_things_are_named(world, tmp_path):
    with pytest.raises(InputError, match=r"dataset\.root=.*nowhere: no such folder"):
        read(tmp_path / "nowhere")
    (world / "map" / "03.png").unlink()
    with pytest.raises(InputError, match=r"map/03\.png'?: listed but not there"):
        read(world)


def test_an_empty_map_is_named(tmp_path):
    (tmp_path / "map").mkdir()
    (tmp_path / "query").mkdir()
    with pytest.raises(InputError, match="map: holds no image"):
        read(tmp_path)
    write_csv(tmp_path / "map.csv", ["map_file", "drive", "index"], [])
    with pytest.raises(InputError, match=r"map\.csv: holds no row"):
        read(tmp_path)


def test_a_missing_column_and_a_repeated_image_are_named(world):
    write_csv(world / "map.csv", ["map_file", "index"], [["map/00.png", 1]])
    with pytest.raises(InputError, match="lacks the column drive"):
        read(world)
    write_csv(world / "map.csv", ["map_file", "drive", "index"], [["map/00.png", "d", 1]] * 2)
    with pytest.raises(InputError, match=r"map/00\.png twice"):
        read(world)


def test_labels_follow_the_folders_of_their_queries(world):
    for folder in ("query", "labels"):
        (world / folder / "a").mkdir()
        (world / folder / "00.png").rename(world / folder / "a" / "00.png")
    write_csv(world / "pairs.csv", ["query_file", "drive", "query_index"], [["query/a/00.png", "d", 0]])
    (world / "annotations.json").unlink()
    assert read(world).labels == (world / "labels" / "a" / "00.png",)


def test_the_digest_follows_the_bytes(world):
    before = read(world).map[0].digest
    Image.fromarray(texture(77)).save(world / "map" / "00.png")
    assert read(world).map[0].digest != before
    assert np.all([len(f.digest) == 64 for f in read(world).map])


def annotated(root, annotations="", classes=()):
    boxes = read_folder(root, Folder(annotations=str(annotations), classes=list(classes))).boxes
    return [b.tolist() for b in boxes]


def test_cvat_and_labelme_are_found_and_two_at_once_refused(world):
    expected = [[], [[40, 60, 80, 100]], [], [[40, 60, 80, 100]], [], []]
    cvat(world / "annotations.xml", BOX.replace("40.5", "40"))
    with pytest.raises(InputError, match=r"annotations\.json and in annotations\.xml"):
        annotated(world)
    assert annotated(world, world / "annotations.json") == expected
    (world / "annotations.json").unlink()
    assert annotated(world) == [[], [[40, 60, 80, 100]], [[150, 0, 160, 15]], [], [], []]
    assert annotated(world, classes=["car"]) == [[], [[40, 60, 80, 100]], [], [], [], []]
    (world / "annotations.xml").unlink()
    for i in (1, 3):
        labelme(world / "query" / f"{i:02d}.json", f"{i:02d}.png", shape([[80, 100], [40, 60]]))
    assert annotated(world) == expected


def test_labelme_files_beside_the_images_are_not_said_to_be_left_out(world, caplog):
    labelme(world / "query" / "01.json", "01.png")
    for name in ("annotations.json", "map.csv", "pairs.csv"):
        (world / name).unlink()
    assert annotated(world) == [[]] * 6
    assert "left out" not in caplog.text
