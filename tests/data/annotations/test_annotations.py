import pytest

from fdslam.data.annotations import READERS, find_annotations, read_annotations
from fdslam.errors import InputError
from tests.data.annotations.samples import coco, cvat, labelme


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
