import numpy as np
import pytest

from fdslam.compact.gradients import ORIENTATIONS, Gradients
from fdslam.compact.signs import centring
from fdslam.config import Dense
from tests.data.worlds import texture

SOURCE = Gradients(Dense(source="gradients"))


def test_shapes_and_grids():
    for size in ((120, 160), (37, 200), (16, 4000), (9, 9), (700, 900)):
        image = texture(0, *size)
        for level, grid, bins in zip(SOURCE.describe(image), SOURCE.grids(*size), ORIENTATIONS, strict=True):
            assert level.dtype == np.float32
            assert level.shape == (grid.rows, grid.cols, 9 * (bins + 1))
            assert np.isfinite(level).all()
            # The grid lies over the whole image: its last cells begin inside.
            assert (grid.rows - 1) * grid.step_y < size[0] <= grid.rows * grid.step_y + 1e-6
            assert (grid.cols - 1) * grid.step_x < size[1] <= grid.cols * grid.step_x + 1e-6


def test_what_is_told_is_relative_to_the_places_around():
    bright = np.clip(texture(0).astype(int) + np.linspace(0, 120, 160, dtype=int)[:, None], 0, 255).astype(np.uint8)
    for level in SOURCE.describe(bright):
        for part in (level[..., :-9], level[..., -9:]):  # gradients, then nine log intensities
            assert np.abs(part.astype(float).mean(axis=2)).max() < 1e-5
            assert part.std() > 0.01


@pytest.mark.parametrize("grey", [0, 114, 255])
def test_an_image_of_one_grey_has_no_gradient(grey):
    for level in SOURCE.describe(np.full((120, 160, 3), grey, np.uint8)):
        assert np.isfinite(level).all()
        assert np.abs(level).max() < 1e-5


def grey_texture(seed, low, high):
    """Grey, so that the weights of the colours round nothing; from low to high."""
    one = texture(seed, 96, 128)[..., 0].astype(float)
    return np.repeat((low + (high - low) * one / 255).astype(np.uint8)[..., None], 3, axis=2)


def test_another_brightness_leaves_nearly_all_signs():
    # log(factor · v + DARK) is log(v + DARK) and a constant, but for the dark: there it is not told from noise.
    image = grey_texture(3, 40, 120)
    for one, other in zip(SOURCE.describe(image), SOURCE.describe(2 * image), strict=True):
        fitted = centring([one], 256)
        apart = np.bitwise_count(fitted.signs(one) ^ fitted.signs(other)).sum() / (one.shape[0] * one.shape[1])
        assert apart < 0.05 * fitted.bits
        blank = SOURCE.describe(grey_texture(4, 40, 120))[0 if one.shape[2] < 100 else 1]
        assert np.bitwise_count(fitted.signs(one) ^ fitted.signs(blank)).mean() > 10


def test_light_by_a_factor_is_gone_where_nothing_is_added(monkeypatch):
    monkeypatch.setattr("fdslam.compact.gradients.DARK", 0.0)
    image = grey_texture(3, 10, 80)
    for one, other in zip(_unscaled(image), _unscaled(3 * image), strict=True):
        assert np.allclose(one, other, atol=2e-5)
        assert np.abs(one).max() > 0.1


def _unscaled(image):
    """Descriptors at the image's own size, so that no rounding of a resized image comes in."""
    size = image.shape[0] * image.shape[1] * 0.1875 / 1000
    return Gradients(Dense(source="gradients", kilobytes=size)).describe(image)


def test_a_turned_edge_is_another_orientation():
    image = np.zeros((128, 128, 3), np.uint8)
    image[:, 64:] = 200
    fine, _ = SOURCE.describe(image)
    turned, _ = SOURCE.describe(np.ascontiguousarray(image.transpose(1, 0, 2)))
    middle, bins = fine.shape[0] // 2, ORIENTATIONS[0]

    def strongest(level):
        gradients = level[middle, middle, : 9 * bins].reshape(9, bins)  # of nine places
        return int(gradients[4].argmax())

    assert strongest(fine) == 0  # the gradient points along x
    assert strongest(turned) == bins // 2


def test_the_bytes_are_part_of_the_identity():
    other = Gradients(Dense(source="gradients", kilobytes=5))
    assert SOURCE.identity != other.identity
    assert SOURCE.grids(360, 480) != other.grids(360, 480)
