import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from fdslam.data.annotations import AnnotatedImage, Annotation, match_boxes
from fdslam.errors import InputError
from fdslam.types import Frame
from tests.data.worlds import texture


@pytest.fixture
def base(tmp_path):
    for name in ("query/00.png", "query/01.png", "map/00.png", "map/02.png"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        Image.fromarray(texture(0)).save(tmp_path / name)
    return tmp_path


def frames(base):
    return [Frame(f"query/{i:02d}.png", base / "query" / f"{i:02d}.png", "", 120, 160) for i in range(2)]


def image(file, *boxes, folder="elsewhere", size=None):
    found = tuple(Annotation(box, label, f"a.xml, line {n}") for n, (box, label) in enumerate(boxes, 3))
    return AnnotatedImage(file, folder, size, found, f"a.xml of {file}")


def match(base, *images, classes=()):
    return [b.tolist() for b in match_boxes(images, frames(base), (base, base / "query"), classes)]


BOX = ((10.0, 20.0, 30.0, 50.0), "car")


@pytest.mark.parametrize(
    ("file", "folder"),
    [("query/01.png", "x"), ("01.png", "x"), ("../query/01.png", "x"), ("../../query/01.png", "x/y"), ("./01.png", "")],
)
def test_a_name_is_found_with_and_without_its_folder(base, file, folder):
    (base / "x" / "y").mkdir(parents=True)
    assert match(base, image(file, BOX, folder=base / folder)) == [[], [[10, 20, 30, 50]]]


def test_a_map_image_of_the_same_name_is_not_the_query(base):
    assert match(base, image("map/00.png", BOX, folder=base)) == [[], []]
    assert match(base, image("00.png", BOX, folder=base / "map")) == [[[10, 20, 30, 50]], []]  # query/ comes first


def test_a_name_that_is_not_there_is_an_error_where_something_is_annotated(base):
    assert match(base, image("07.png", folder=base)) == [[], []]
    for name in ("07.png", "x" * 5000, "a\0b"):
        with pytest.raises(InputError, match=r"a\.xml, line 3 is of .*no image here; names must be as in 'query/00"):
            match(base, image(name, BOX, folder=base))


def test_a_query_that_a_complete_list_lacks_is_said(base, caplog):
    images = [image("00.png", BOX, folder=base)]
    for complete, said in ((False, False), (True, True)):
        assert len(match_boxes(images, frames(base), (base / "query",), complete=complete)) == 2
        assert ("1 of 2 queries are not in the annotations and count as unchanged: query/01.png" in caplog.text) is said


def test_two_annotations_of_one_image_are_named(base):
    with pytest.raises(
        InputError, match=r"a\.xml of 01\.png: '01\.png' is annotated already by a\.xml of query/01\.png"
    ):
        match(base, image("query/01.png", folder=base), image("01.png", BOX, folder=base))


def test_another_size_is_named(base):
    with pytest.raises(InputError, match=r"01\.png: is 160×120 pixels, a\.xml of 01\.png says 120×160"):
        match(base, image("01.png", folder=base, size=(120, 160)))


def test_boxes_outside_are_named_and_others_cut(base):
    assert match(base, image("00.png", ((150, -5, 180, 15), "car"), folder=base)) == [[[150, 0, 160, 15]], []]
    for box in ((160, 0, 170, 10), (-9, -9, 0.5, 9), (0, 119.5, 9, 130)):
        with pytest.raises(
            InputError, match=r"a\.xml, line 3 from \(.*\) to \(.*\) lies outside query/00\.png \(160×120"
        ):
            match(base, image("00.png", (box, "car"), folder=base))


def test_classes_choose_what_counts(base):
    other = ((500.0, 500.0, 501.0, 502.0), "sign")  # not checked: it does not count
    one = image("00.png", BOX, other, ((1.0, 2.0, 3.0, 4.0), "bin"), folder=base)
    assert match(base, one, classes=["bin", "car"]) == [[[10, 20, 30, 50], [1, 2, 3, 4]], []]
    with pytest.raises(InputError, match=r"dataset\.classes: nothing is annotated as 'caar'; .*bin, car, sign"):
        match(base, one, classes=["car", "caar"])


@given(st.tuples(*[st.floats(-300, 300, width=32)] * 4).filter(lambda b: b[0] < b[2] and b[1] < b[3]))
def test_what_is_returned_lies_inside(base_of_module, box):
    try:
        [[x0, y0, x1, y1]] = match(base_of_module, image("00.png", (box, "car"), folder=base_of_module))[0]
    except InputError:
        overlap = np.minimum(box[2:], (160, 120)) - np.maximum(box[:2], 0)
        assert (overlap < 1).any()
    else:
        assert 0 <= x0 <= x1 - 1
        assert 0 <= y0 <= y1 - 1
        assert x1 <= 160
        assert y1 <= 120


@pytest.fixture(scope="module")
def base_of_module(tmp_path_factory):
    base = tmp_path_factory.mktemp("base")
    (base / "query").mkdir()
    for name in ("00.png", "01.png"):
        Image.fromarray(texture(0)).save(base / "query" / name)
    return base
