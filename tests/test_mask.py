from dataclasses import replace

import numpy as np
import pytest

from fdslam.config import Folder, Mask
from fdslam.data.folder import read_folder
from fdslam.data.images import read_image
from fdslam.errors import InputError
from fdslam.mask import apply_masks, dull_pixels, load_masks, masked_cells, segmentation
from fdslam.segmentation import Segmentation
from fdslam.store import Store
from fdslam.types import CELL, LABELS
from tests.data.worlds import small_world
from tests.onnx_models import painter

SKY, GROUND, BUILDING = (LABELS.index(name) for name in ("sky", "ground", "building"))


def masks(data, config, tmp_path):
    return load_masks(data, config, segmentation(config, "cpu"), Store(tmp_path / "s"), 2)


@pytest.mark.parametrize("min_share", [0.3, 0.5, 1.0])
@pytest.mark.parametrize(("height", "width"), [(27, 34), (30, 40), (16, 41), (30, 39)])
def test_equals_the_loop_over_cells(min_share, height, width):
    labels = np.random.default_rng(0).integers(0, len(LABELS), (height, width)).astype(np.uint8)
    labels[:10, :10] = SKY
    labels[-7:, 30:] = GROUND
    dull = dull_pixels(labels)
    assert dull.dtype == np.uint8
    assert dull.max() == CELL * CELL
    found = masked_cells(dull, height, width, min_share)
    for r in range(-(-height // CELL)):
        for c in range(-(-width // CELL)):
            cell = labels[r * CELL : (r + 1) * CELL, c * CELL : (c + 1) * CELL]
            count = sum(value in (SKY, GROUND) for value in cell.ravel())
            assert dull[r, c] == count
            assert found[r, c] == (count / cell.size >= min_share)


def test_one_pixel_of_something_else_keeps_the_cell():
    labels = np.full((20, 20), SKY, np.uint8)
    labels[3, 4] = BUILDING
    assert masked_cells(dull_pixels(labels), 20, 20, 1.0).tolist() == [[False, True], [True, True]]


def test_masked_cells_fall_to_zero_or_below_everything():
    mask = [np.array([[True, False]])]
    assert apply_masks([np.array([[5.0, 3.0]], np.float32)], mask)[0].tolist() == [[0, 3]]
    # AD's z may be negative: 0 would put a masked cell above cells that count.
    low = [np.array([[5.0, -3.0]], np.float32)]
    assert apply_masks(low, mask)[0].tolist() == [[-3, -3]]
    assert apply_masks(low, None)[0] is low[0]


def test_a_query_without_labels_is_named(tmp_path):
    data = read_folder(small_world(tmp_path), Folder())
    assert masks(data, Mask("none"), tmp_path) is None
    assert masks(data, Mask("labels"), tmp_path)[0][:3].all()
    (tmp_path / "labels" / "02.png").unlink()
    data = read_folder(tmp_path, Folder())
    with pytest.raises(InputError, match=r"no label image for query/02\.png"):
        masks(data, Mask("labels"), tmp_path)


def test_a_model_masks_what_its_labels_mask_and_is_asked_once(tmp_path):
    data = read_folder(small_world(tmp_path), Folder())
    path = painter(tmp_path / "m.onnx", len(LABELS))
    config = Mask("deeplabv3plus", min_share=0.5, weights=str(path), normalise="unit")
    model = Segmentation(config)
    found = masks(data, config, tmp_path)
    labels = [model.labels(read_image(frame.path)) for frame in data.query]
    for mask, one in zip(found, labels, strict=True):
        assert np.array_equal(mask, masked_cells(dull_pixels(one), *one.shape, 0.5))
    assert 0.02 < np.mean(found) < 0.98
    stored = {file: file.stat().st_mtime_ns for file in (tmp_path / "s" / "mask").rglob("*.safetensors")}
    assert len(stored) == len(data.query)
    again = masks(data, replace(config, min_share=1.0, threads=2), tmp_path)
    assert all((a <= b).all() for a, b in zip(again, found, strict=True))  # the share is taken of what is stored
    assert {file: file.stat().st_mtime_ns for file in stored} == stored
    assert len(list((tmp_path / "s" / "mask").rglob("*.safetensors"))) == len(stored)
    masks(data, replace(config, channels="bgr"), tmp_path)
    assert len(list((tmp_path / "s" / "mask").rglob("*.safetensors"))) == 2 * len(stored)
