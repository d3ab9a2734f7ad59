import pytest

from fdslam.errors import InputError
from fdslam.obb.yolo.names import COCO, chosen_classes, class_names, named_by


def test_coco_has_80_different_names():
    assert len(set(COCO)) == 80
    assert (COCO[0], COCO[2], COCO[16], COCO[79]) == ("person", "car", "dog", "toothbrush")


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("{0: 'person', 1: 'car'}", ("person", "car")),
        ('{"1": "car", "0": "person"}', ("person", "car")),
        ('["person", "car"]', ("person", "car")),
        ("{0: 'a', 2: 'b'}", ()),
        ("{'a': 0}", ()),
        ("person, car", ()),
        ("__import__('os')", ()),
        ("[" * 500, ()),
        ("3", ()),
        ("", ()),
    ],
)
def test_names_of_the_metadata(text, names):
    assert named_by({"names": text}) == names


def test_whose_names():
    assert class_names({"names": "['a', 'b']"}, 2) == ("a", "b")
    assert class_names({}, 80) == COCO
    assert class_names({}, 3) == ()


def test_chosen_by_name_or_number():
    assert chosen_classes([], COCO, 80) == tuple(range(80))
    assert chosen_classes(["dog", "0", "16"], COCO, 80) == (0, 16)
    assert chosen_classes(["2"], (), 3) == (2,)


@pytest.mark.parametrize(
    ("wanted", "names", "said"),
    [
        (["cars"], COCO, "obb.yolo.classes=cars: the model has no such class; near: car"),
        (["80"], COCO, "or a number from 0 to 79"),
        (["car"], (), "does not name its classes; give numbers from 0 to 79"),
    ],
)
def test_a_class_that_is_not_there(wanted, names, said):
    with pytest.raises(InputError, match=said):
        chosen_classes(wanted, names, 80)
