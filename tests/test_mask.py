import numpy as np
import pytest

from fdslam.config import Folder, Mask
from fdslam.data.folder import read_folder
from fdslam.errors import InputError
from fdslam.mask import apply_masks, load_masks, masked_cells
from fdslam.types import CELL, LABELS
from tests.data.worlds import small_world

SKY, GROUND, BUILDING = (LABELS.index(name) for name in ("sky", "ground", "building"))


@pytest.mark.parametrize("min_share", [0.3, 0.5, 1.0])
def test_equals_the_loop_over_cells(min_share):
    labels = np.random.default_rng(0).integers(0, len(LABELS), (27, 34)).astype(np.uint8)
    labels[:10, :10] = SKY
    labels[20:, 30:] = GROUND
    found = masked_cells(labels, min_share)
    for r in range(3):
        for c in range(4):
            cell = labels[r * CELL : (r + 1) * CELL, c * CELL : (c + 1) * CELL]
            share = sum(value in (SKY, GROUND) for value in cell.ravel()) / cell.size
            assert found[r, c] == (share >= min_share)


def test_one_pixel_of_something_else_keeps_the_cell():
    labels = np.full((20, 20), SKY, np.uint8)
    labels[3, 4] = BUILDING
    assert masked_cells(labels, 1.0).tolist() == [[False, True], [True, True]]


def test_masked_cells_fall_to_zero_or_below_everything():
    mask = [np.array([[True, False]])]
    assert apply_masks([np.array([[5.0, 3.0]], np.float32)], mask)[0].tolist() == [[0, 3]]
    # AD's z may be negative: 0 would put a masked cell above cells that count.
    low = [np.array([[5.0, -3.0]], np.float32)]
    assert apply_masks(low, mask)[0].tolist() == [[-3, -3]]
    assert apply_masks(low, None)[0] is low[0]


def test_a_query_without_labels_is_named(tmp_path):
    data = read_folder(small_world(tmp_path), Folder())
    assert load_masks(data, Mask("none")) is None
    assert load_masks(data, Mask("labels"))[0][:3].all()
    (tmp_path / "labels" / "02.png").unlink()
    data = read_folder(tmp_path, Folder())
    with pytest.raises(InputError, match=r"no label image for query/02\.png"):
        load_masks(data, Mask("labels"))
