"""Augmentation against images whose objects are rectangles of one colour."""

import numpy as np
import pytest

from experiments.train.data import GREY, IGNORED, LEFT, Sample, batches, crop, mosaic, placed, recolored, sample_of
from experiments.train.views import Views

BOX = np.array([[20.0, 30, 60, 90]], np.float32)


def painted(boxes: np.ndarray, height: int = 120, width: int = 100) -> Sample:
    image, labels = np.full((height, width, 3), 40, np.uint8), np.zeros((height, width), np.uint8)
    for x0, y0, x1, y1 in boxes.astype(int):
        image[y0:y1, x0:x1], labels[y0:y1, x0:x1] = 200, 4
    return Sample(image, labels, np.zeros(len(boxes), np.int64), boxes, np.ones(len(boxes), bool))


def outline(mask: np.ndarray) -> np.ndarray:
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    return np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1])


@pytest.mark.parametrize("seed", range(8))
def test_image_labels_and_boxes_move_together(seed):
    rng = np.random.default_rng(seed)
    moved = crop(rng, painted(BOX), (1.5, 1.2), (0.6, 1.4), (96, 112), np.array([40.0, 60]))
    assert moved.image.shape == (96, 112, 3)
    assert moved.labels.shape == (96, 112)
    assert len(moved.boxes) == 1
    np.testing.assert_allclose(outline(moved.labels == 4), moved.boxes[0], atol=0.51)  # of a pixel's centre
    bright = moved.image[..., 0] > 120
    assert np.abs(outline(bright) - moved.boxes[0]).max() <= 1.5


def test_a_mirrored_view_is_the_mirror_image():
    sample = painted(BOX)
    mirrored = placed(sample, np.array([[-1.0, 0, 100], [0, 1, 0]]), 120, 100)
    assert (mirrored.image == sample.image[:, ::-1]).all()
    assert (mirrored.labels == sample.labels[:, ::-1]).all()
    assert mirrored.boxes.tolist() == [[40, 30, 80, 90]]


def test_around_the_view_is_grey_that_does_not_count():
    small = placed(painted(BOX), np.array([[1.0, 0, 10], [0, 1, 5]]), 200, 150)
    assert (small.image[:5] == GREY).all()
    assert (small.labels[:5] == IGNORED).all()
    assert (small.labels[5:125, 10:110] != IGNORED).all()


def test_an_object_cut_to_less_than_its_share_is_not_asked_for():
    for shift, asked in ((-30.0, True), (-50.0, False)):  # 30 and 10 of its 40 pixels are left
        cut = placed(painted(BOX), np.array([[1.0, 0, shift], [0, 1, 0]]), 120, 100)
        assert cut.clear.tolist() == [asked], LEFT
    gone = placed(painted(BOX), np.array([[1.0, 0, -70], [0, 1, 0]]), 120, 100)
    assert len(gone.boxes) == len(gone.classes) == len(gone.clear) == 0


def test_a_mosaic_holds_its_parts_objects():
    sample = painted(BOX)
    views = Views(
        sample.image[None],
        sample.labels[None],
        np.zeros(1, bool),
        np.zeros(1, np.int64),
        np.array([3]),
        BOX,
        np.ones(1, bool),
    )
    assert (sample_of(views, 0).image == sample.image).all()
    four = mosaic(np.random.default_rng(0), views, (1.0, 1.0), (0.5, 0.9), (160, 160))
    assert four.image.shape == (160, 160, 3)
    assert len(four.boxes) == 4
    assert set(four.classes) == {3}
    for x0, y0, x1, y1 in np.rint(four.boxes).astype(int):
        assert (four.labels[y0 + 1 : y1 - 1, x0 + 1 : x1 - 1] == 4).all()


def test_recolouring_keeps_the_shape_and_changes_the_colours():
    image = np.random.default_rng(1).integers(0, 256, (40, 50, 3), dtype=np.uint8)
    others = [recolored(np.random.default_rng(k), image) for k in range(20)]
    assert all(o.shape == image.shape and o.dtype == np.uint8 for o in others)
    assert sum((o != image).any() for o in others) >= 15
    assert (others[3] == recolored(np.random.default_rng(3), image)).all()


@pytest.mark.parametrize("ahead", [1, 5, 50])
def test_batches_depend_on_seed_and_epoch_alone(ahead):
    def make(rng: np.random.Generator, index: int) -> tuple[int, float]:
        return index, rng.random()

    first = list(batches(23, 4, 1, 2, make))
    assert list(batches(23, 4, 1, 2, make, ahead)) == first
    assert [len(b) for b in first] == [4] * 5
    assert len({index for b in first for index, _ in b}) == 20
    assert list(batches(23, 4, 1, 3, make)) != first
    assert list(batches(23, 4, 2, 2, make)) != first
