import pytest

from fdslam.data.annotations.labelme import read_labelme
from fdslam.errors import InputError
from tests.data.annotations.samples import coco, labelme, shape


def test_reads_names_sizes_boxes_and_labels(tmp_path):
    labelme(
        tmp_path / "b.json", "..\\query\\01.png", shape([[80, 100], [40.5, 60]]), shape([[1, 2], [3, 4]], label="é")
    )
    labelme(tmp_path / "a" / "a.json", "00.png", imageHeight=None)
    first, second = read_labelme(tmp_path)
    assert (first.file, first.folder, first.size, first.annotations) == ("00.png", tmp_path / "a", None, ())
    assert (second.file, second.size) == ("../query/01.png", (160, 120))
    assert [(a.xyxy, a.label) for a in second.annotations] == [((40.5, 60, 80, 100), "car"), ((1, 2, 3, 4), "é")]
    assert second.annotations[1].where == f"{tmp_path / 'b.json'}: shape 2 'é'"


@pytest.mark.parametrize(
    ("kind", "points", "xyxy"),
    [
        ("polygon", [[10.5, 20], [30, 5], [12, 40]], (10.5, 5, 30, 40)),
        (None, [[1, 2], [3, 4], [0, 9]], (0, 2, 3, 9)),
        ("oriented_rectangle", [[0, 5], [5, 0], [10, 5], [5, 10]], (0, 0, 10, 10)),
        ("circle", [[50, 40], [53, 44]], (45, 35, 55, 45)),
        ("mask", [[7, 8], [9, 9]], (7, 8, 10, 10)),
        ("mask", [[7, 8], [7, 8]], (7, 8, 8, 9)),
    ],
)
def test_every_shape_becomes_the_box_around_it(tmp_path, kind, points, xyxy):
    labelme(tmp_path / "a.json", "a.png", shape(points, kind))
    assert read_labelme(tmp_path)[0].annotations[0].xyxy == pytest.approx(xyxy)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (shape([[1, 2]], "point"), r"shape 1 'car' is a 'point', which has no area here; draw one of rectangle"),
        (shape([[1, 2], [3, 4]], "linestrip"), "'linestrip', which has no area"),
        (shape([[1, 2], [3, 4]], "hexagon"), "'hexagon', which has no area"),
        (shape([[1, 2], [3, 4]], ["polygon"]), "which has no area"),
        (shape([[1, 2], [1, 4]]), "shape 1 'car' cannot be read: it is empty"),
        (shape([]), "it has no points"),
        (shape([[1, 2], [3]]), r"\[3\] is no point"),
        (shape([[1, 2], ["3", 4]]), "'3' is no number of pixels"),
        (shape([[1, 2], [True, 4]]), "True is no number of pixels"),
        (shape([[1, 2], [float("nan"), 4]]), "nan is no number of pixels"),
        (shape([[1, 2], [10**400, 4]]), "is no number of pixels"),
        (shape([[1, 2], [3, 4], [5, 6]], "circle"), "it has 3 points and not 2"),
        (shape("1, 2"), "shape 1 has no points"),
        ("rectangle", "shape 1 has no points"),
        (shape([[1, 2], [3, 4]], label=None), "shape 1 has the label None"),
    ],
)
def test_a_shape_that_cannot_be_read_is_named(tmp_path, content, said):
    labelme(tmp_path / "a.json", "a.png", content)
    with pytest.raises(InputError, match=rf"a\.json: .*{said}") as raised:
        read_labelme(tmp_path)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"imagePath": 3}, "not LabelMe annotations"),
        ({"imagePath": ""}, "not LabelMe annotations"),
        ({"shapes": {}}, "not LabelMe annotations"),
        ({"imageWidth": -1}, "the width is -1"),
        ({"imageHeight": "120"}, "the height is '120'"),
        ({"imageHeight": 1e999}, "the height is inf"),
        ({"imageHeight": 10.5}, r"the height is 10\.5"),
    ],
)
def test_a_file_with_wrong_types_is_named(tmp_path, changes, said):
    labelme(tmp_path / "a.json", "a.png", **changes)
    with pytest.raises(InputError, match=rf"a\.json: {said}"):
        read_labelme(tmp_path)


def test_a_syntax_error_is_named_with_its_line(tmp_path):
    path = labelme(tmp_path / "a.json", "a.png", shape([[1, 2], [3, 4]]))
    path.write_text(path.read_text().replace('"imagePath"', "imagePath"))
    line = path.read_text()[: path.read_text().index("imagePath")].count("\n") + 1
    with pytest.raises(InputError, match=rf"a\.json, line {line}, column 3: no JSON"):
        read_labelme(tmp_path)
    path.write_bytes(b"\xff\xfe{")
    with pytest.raises(InputError, match=r"a\.json: no JSON in UTF-8"):
        read_labelme(tmp_path)
    path.write_text("[1, 2]")
    with pytest.raises(InputError, match=r"a\.json: holds a list, no LabelMe annotations"):
        read_labelme(tmp_path)


def test_an_empty_folder_and_a_coco_file_are_named(tmp_path):
    with pytest.raises(InputError, match="holds no LabelMe JSON"):
        read_labelme(tmp_path)
    coco(tmp_path / "instances_default.json")  # where CVAT's export to COCO puts it
    with pytest.raises(
        InputError, match=r"COCO and not LabelMe; give .*dataset\.annotations=.*instances_default\.json"
    ):
        read_labelme(tmp_path)
