import numpy as np
import pytest

from fdslam.bow.orb import extract, take_turns
from fdslam.config import Orb


def textured(height=120, width=200, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


def turns_by_hand(cell, response, wanted):
    """Cells take turns: in each round the strongest left of every cell, stronger ones first."""
    left = {c: sorted((i for i in range(len(cell)) if cell[i] == c), key=lambda i: (-response[i], i)) for c in cell}
    chosen = []
    while any(left.values()):
        chosen += sorted((items.pop(0) for items in left.values() if items), key=lambda i: (-response[i], i))
    return sorted(chosen[:wanted])


@pytest.mark.parametrize("seed", range(20))
def test_cells_take_turns(seed):
    rng = np.random.default_rng(seed)
    cell, response = rng.integers(0, 5, 30), rng.integers(0, 10, 30).astype(np.float32)
    for wanted in (0, 1, 7, 30, 50):
        assert list(take_turns(cell, response, wanted)) == turns_by_hand(list(cell), list(response), wanted)


def test_grid_spreads_the_keypoints():
    image = np.full((200, 200, 3), 128, np.uint8)
    image[:100, :100] = textured(100, 100)  # strong corners
    image[100:, 100:] = 64 + textured(100, 100, seed=1) // 2  # weak ones
    count = {}
    for grid in (0, 8):
        found = extract(image, Orb(features=200, grid=grid, min_side=0))
        assert len(found.xy) <= 200
        count[grid] = int((found.xy > 100).all(axis=1).sum())
    assert count[8] > count[0]
    assert count[8] >= 60


@pytest.mark.parametrize("min_side", [0, 240])
def test_positions_are_in_pixels_of_the_original(min_side):
    image = np.full((120, 160, 3), 40, np.uint8)
    image[50:70, 90:110] = 220  # corners at (90, 50), (110, 50), (90, 70), (110, 70)
    xy = extract(image, Orb(features=100, min_side=min_side)).xy
    assert len(xy)
    corners = np.array([[90, 50], [110, 50], [90, 70], [110, 70]])
    nearest = np.linalg.norm(xy[:, None] - corners[None], axis=2)
    assert nearest.min(axis=1).max() < 6
    offset = xy - corners[nearest.argmin(axis=1)]
    assert np.abs(offset.mean(axis=0)).max() < 1  # no systematic shift: upscaling respects pixel centres


def test_blank_image_has_no_feature():
    found = extract(np.zeros((64, 64, 3), np.uint8), Orb())
    assert found.xy.shape == (0, 2)
    assert found.descriptors.shape == (0, 32)


def test_tiny_image_is_no_error():
    assert len(extract(textured(16, 16), Orb(min_side=0)).xy) == 0  # smaller than ORB's patch
