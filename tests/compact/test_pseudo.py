import numpy as np
import pytest

from fdslam.compact.pseudo import AREA, PATCHES, pseudo_query
from tests.data.worlds import texture

IMAGE = texture(0)
FOREIGN = [texture(10), texture(11, 90, 200)]


def made(seed, image=IMAGE, foreign=FOREIGN):
    return pseudo_query(image, foreign, np.random.default_rng(seed))


def test_the_seed_decides_everything():
    for seed in range(5):
        one, two = made(seed), made(seed)
        assert np.array_equal(one[0], two[0])
        assert np.array_equal(one[1], two[1])
    assert not np.array_equal(made(0)[0], made(1)[0])


@pytest.mark.parametrize("size", [(120, 160), (37, 91), (200, 40)])
def test_size_and_dtype_stay_and_the_mask_is_a_share(size):
    image = texture(2, *size)
    before, donors = image.copy(), [one.copy() for one in FOREIGN]
    for seed in range(30):
        drawn, mask = made(seed, image)
        assert drawn.dtype == np.uint8
        assert drawn.shape == image.shape
        assert mask.dtype == np.float32
        assert mask.shape == size
        assert 0 <= mask.min() <= mask.max() <= 1 + 1e-6
    assert np.array_equal(image, before)
    assert all(np.array_equal(one, two) for one, two in zip(FOREIGN, donors, strict=True))


def test_patches_are_of_the_sizes_that_are_said():
    shares = np.array([made(seed)[1].mean() for seed in range(100)])
    assert (shares == 0).mean() > 0.5 / (PATCHES + 1)  # some images have changed nowhere
    assert (shares == 0).mean() < 2.5 / (PATCHES + 1)
    assert shares.max() < PATCHES * AREA[1]
    assert AREA[0] / 2 < np.median(shares[shares > 0]) < 2 * AREA[1]


def test_what_is_foreign_is_where_the_mask_says():
    # A black image with white patches in it: what is bright is what is foreign, whatever the light.
    black, white = np.zeros((120, 160, 3), np.uint8), [np.full((120, 160, 3), 255, np.uint8)]
    told = 0
    for seed in range(30):
        drawn, mask = made(seed, black, white)
        sure, none = mask > 0.99, mask == 0
        if sure.any():
            bright, dark = drawn[sure].mean(axis=1), drawn[none].mean()
            assert np.median(bright) > dark + 30
            told += 1
        plain = drawn[none].astype(float)
        assert plain.std() < 20
    assert told > 15


def test_without_donors_nothing_is_foreign():
    lights = [made(seed, foreign=[]) for seed in range(10)]
    assert not any(mask.any() for _, mask in lights)
    assert len({drawn.tobytes() for drawn, _ in lights}) == 10
    assert all(not np.array_equal(drawn, IMAGE) for drawn, _ in lights)


@pytest.mark.parametrize("size", [(1, 1), (2, 3), (4, 4), (3, 200), (9, 1)])
def test_tiny_images_are_no_trouble(size):
    tiny = texture(1, *size)
    for seed in range(30):
        drawn, mask = made(seed, tiny)
        assert drawn.shape == tiny.shape
        assert mask.shape == size
        drawn, mask = made(seed, IMAGE, [tiny])
        assert drawn.shape == IMAGE.shape
        if min(size) < 2:
            assert not mask.any()  # nothing to cut a patch from
