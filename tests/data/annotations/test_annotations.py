import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdslam.data.annotations import READERS, find_annotations, read_annotations
from fdslam.errors import InputError
from tests.data.annotations.samples import coco, cvat, labelme, shape


def test_what_there_is_is_found(tmp_path):
    assert find_annotations(tmp_path) is None
    (tmp_path / "query").mkdir()
    assert find_annotations(tmp_path) is None
    for make in (lambda: cvat(tmp_path / "annotations.xml"), lambda: coco(tmp_path / "annotations.json")):
        path = make()
        assert find_annotations(tmp_path) == path
        assert read_annotations(path)[-1].file == "query/02.png"
        path.unlink()
    for folder in ("annotations", "query"):
        path = labelme(tmp_path / folder / "01.json", "01.png")
        assert find_annotations(tmp_path) == path.parent
        assert read_annotations(path.parent)[0].file == "01.png"
        path.unlink()
        (tmp_path / folder).rmdir()


def test_two_at_once_are_named_and_a_path_decides(tmp_path):
    cvat(tmp_path / "annotations.xml")
    path = coco(tmp_path / "annotations.json")
    with pytest.raises(InputError, match=r"annotations in annotations\.json and in annotations\.xml; keep one"):
        find_annotations(tmp_path)
    assert find_annotations(tmp_path, str(path)) == path
    with pytest.raises(InputError, match=r"dataset\.annotations=/nowhere\.xml: not there"):
        find_annotations(tmp_path, "/nowhere.xml")


def test_an_archive_is_to_be_unpacked(tmp_path):
    (tmp_path / "annotations.zip").write_bytes(b"PK")
    with pytest.raises(InputError, match=r"annotations\.zip: COCO ends in \.json.*unpack"):
        read_annotations(tmp_path / "annotations.zip")
    assert set(READERS) == {"coco", "cvat", "labelme"}


WRITERS = {
    "coco": lambda folder: coco(folder / "a.json"),
    "cvat": lambda folder: cvat(folder / "a.xml"),
    "labelme": lambda folder: labelme(folder / "a.json", "01.png", shape([[50, 40], [53, 44]], "circle")),
}


@pytest.mark.parametrize("kind", READERS)
@given(
    at=st.floats(0, 1), length=st.integers(0, 12), put=st.binary(max_size=6) | st.sampled_from([b"NaN", b"-1", b"{}"])
)
def test_whatever_a_damaged_file_holds_is_read_or_named(tmp_path_factory, kind, at, length, put):
    folder = tmp_path_factory.mktemp("damaged")
    path = WRITERS[kind](folder)
    content = path.read_bytes()
    start = int(at * len(content))
    path.write_bytes(content[:start] + put + content[start + length :])
    images, message = (), f"{path}"
    try:
        images = READERS[kind](folder if kind == "labelme" else path)
    except InputError as error:
        message = str(error)
    assert str(path) in message
    assert "\n" not in message
    assert all(one.xyxy[0] < one.xyxy[2] and one.xyxy[1] < one.xyxy[3] for i in images for one in i.annotations)
