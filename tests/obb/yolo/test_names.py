import pytest

from fdslam.errors import InputError
from fdslam.obb.yolo.names import COCO, chosen_classes


def test_coco_has_80_different_names():
    assert len(set(COCO)) == 80
    assert (COCO[0], COCO[2], COCO[16], COCO[79]) == ("person", "car", "dog", "toothbrush")


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
