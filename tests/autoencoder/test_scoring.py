"""Errors against loops over pixels, their statistics against exact sums, regions against loops over boxes."""

import math

import numpy as np
import pytest
import torch

from fdslam.autoencoder.network import ConvAutoencoder, weights_of
from fdslam.autoencoder.scoring import (
    SIGMA_FLOOR,
    error_map,
    error_to_cells,
    moments,
    reconstruction_error,
    region_to_cells,
    statistics,
    z_score,
)
from fdslam.types import CELL
from tests.autoencoder.scenes import SIZE, place
from tests.reference import bilinear, cell_maximum, l1_per_pixel, mean_and_deviation
from tests.reference.errors import gradient_per_pixel, ssim_per_pixel


@pytest.fixture(scope="module")
def pair():
    """Images and something like reconstructions of them."""
    images = place(2, height=16, width=32)
    return images, (0.9 * images + 0.2 * torch.rand(images.shape, generator=torch.Generator().manual_seed(0))).clamp(
        0, 1
    )


@pytest.mark.parametrize(
    ("kind", "oracle"), [("l1", l1_per_pixel), ("ssim", ssim_per_pixel), ("gradient", gradient_per_pixel)]
)
def test_errors_equal_loops_over_pixels(pair, kind, oracle):
    found = error_map(kind, *pair)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, oracle(pair[0].numpy(), pair[1].numpy()), atol=2e-5)


def test_nothing_is_an_error_where_nothing_differs(pair):
    for kind in ("l1", "ssim", "gradient"):
        assert np.abs(error_map(kind, pair[0], pair[0])).max() < 1e-4


def test_statistics_are_those_of_all_pixels(pair):
    found = statistics(*pair)
    for kind, (mu, sigma) in found.items():
        mean, deviation = mean_and_deviation(error_map(kind, *pair))
        assert (mu, sigma) == (pytest.approx(mean), pytest.approx(max(deviation, SIGMA_FLOOR)))


def test_sigma_has_a_floor():
    assert moments(np.full((2, 4, 4), 0.25, dtype=np.float32)) == (0.25, SIGMA_FLOOR)
    values = np.random.default_rng(0).random((2, 4, 4)).astype(np.float32)
    assert moments(values) == pytest.approx(mean_and_deviation(values))


@pytest.mark.parametrize("kind", ["l1", "ssim", "gradient"])
def test_error_does_not_depend_on_the_batch(kind):
    network, images = ConvAutoencoder(SIZE, 8, 32), place(8)
    weights = weights_of(network)
    errors = reconstruction_error(weights, images, kind=kind)
    with torch.no_grad():
        np.testing.assert_allclose(errors, error_map(kind, images, network(images)), atol=1e-4)
    for i in (0, 5):
        alone = reconstruction_error(weights, images[i : i + 1], kind=kind)
        assert alone.tobytes() == errors[i : i + 1].tobytes()
    assert reconstruction_error(weights, images[:0], kind=kind).shape == (0, *SIZE)


def test_z_is_the_definition_and_a_shared_c_cannot_change_a_ranking():
    rng = np.random.default_rng(0)
    errors = rng.random((3, 4, 5)).astype(np.float32)
    mus, sigmas = (0.2, 0.4, 0.3), (0.1, 0.2, 0.05)
    scores = np.stack([z_score(e, m, s) for e, m, s in zip(errors, mus, sigmas, strict=True)])
    assert scores.dtype == np.float32
    for index in np.ndindex(errors.shape):
        i = index[0]
        assert scores[index] == pytest.approx((float(errors[index]) - mus[i]) / sigmas[i], abs=1e-5)
    order = np.argsort(scores, axis=None)
    for c in (0.1, 0.8, 3.0):
        np.testing.assert_array_equal(np.argsort(scores.astype(np.float64) / c, axis=None), order)
    # The statistics of the places, which are not shared, do change it.
    assert not np.array_equal(np.argsort(errors, axis=None), order)


@pytest.mark.parametrize(
    ("shape", "height", "width"),
    [((6, 8), 36, 48), ((8, 6), 41, 33), ((16, 16), 10, 10), ((4, 4), 7, 25), ((5, 3), 1, 1)],
)
def test_cells_equal_a_loop_over_pixels(shape, height, width):
    error = np.random.default_rng(0).standard_normal(shape).astype(np.float32) - 3  # a border filled with 0 would show
    cells = error_to_cells(error, height, width)
    assert cells.dtype == np.float32
    np.testing.assert_allclose(cells, cell_maximum(bilinear(error, height, width), CELL), atol=1e-4)


@pytest.mark.parametrize(("height", "width"), [(36, 48), (23, 31)])
def test_regions_equal_a_loop_over_boxes(height, width):
    rng = np.random.default_rng(1)
    error = rng.standard_normal((8, 6)).astype(np.float32)
    corner = rng.uniform(-8, 20, (20, 2))
    boxes = np.concatenate([corner, corner + rng.uniform(0, 15, (20, 2))], axis=1).astype(np.float32)
    boxes = np.concatenate([boxes, [[5, 5, 5, 9], [60, 60, 70, 70]]]).astype(np.float32)  # one empty, one outside
    pixels = bilinear(error, height, width)
    total, covered = np.zeros((height, width)), np.zeros((height, width))
    for x0, y0, x1, y1 in boxes.tolist():
        inside = [
            (y, x) for y in range(height) for x in range(width) if x0 <= x < x1 and y0 <= y < y1
        ]  # pixel x belongs to a half-open box when x0 <= x < x1
        for y, x in inside:
            total[y, x] += math.fsum(pixels[p] for p in inside) / len(inside)
            covered[y, x] += 1
    expected = np.divide(total, covered, out=np.full((height, width), -7.0), where=covered > 0)
    assert (covered == 0).any()
    assert covered.max() >= 2
    found = region_to_cells(error, boxes, height, width, outside=-7.0)
    np.testing.assert_allclose(found, cell_maximum(expected, CELL), atol=1e-4)
    shuffled = region_to_cells(error, boxes[rng.permutation(len(boxes))], height, width, outside=-7.0)
    assert shuffled.tobytes() == found.tobytes()
    nothing = region_to_cells(error, boxes[:0], height, width, outside=-7.0)
    assert (nothing == -7).all()
