"""The network's shapes, and its input against its definition."""

import numpy as np
import pytest
import torch

from fdslam.autoencoder.network import ConvAutoencoder, input_size, network_with, prepare, weights_of
from fdslam.errors import InputError
from tests.autoencoder.scenes import SIZE


@pytest.mark.parametrize("image", [(360, 480), (384, 1024), (1000, 90), (7, 5000), (64, 64)])
@pytest.mark.parametrize("pixels", [1024, 12_288, 60_000])
def test_input_size_is_the_nearest_of_all_multiples_of_16(image, pixels):
    height, width = input_size(*image, pixels)
    sides = np.arange(16, 4097, 16)
    want = [(pixels * image[0] / image[1]) ** 0.5, (pixels * image[1] / image[0]) ** 0.5]
    if min(want) < 16:  # too narrow: the area is kept, the aspect cannot be
        want = [16 if side < 16 else pixels / 16 for side in want]
    assert input_size(360, 480, 12_288) == (96, 128)
    assert [height, width] == [sides[np.abs(sides - side).argmin()] for side in want]


@pytest.mark.parametrize("size", [(16, 16), (32, 48), (96, 128)])
@pytest.mark.parametrize("count", [1, 3])
def test_network_returns_images_of_its_input(size, count):
    images = torch.rand(count, 3, *size, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        out = ConvAutoencoder(size, 4, 16)(images)
    assert out.shape == images.shape
    assert out.dtype == torch.float32
    assert 0 <= out.min() <= out.max() <= 1


def test_network_narrows_to_its_code_and_refuses_other_sizes():
    network = ConvAutoencoder((32, 48), 4, 16)
    assert network.encoder(torch.zeros(1, 3, 32, 48)).shape == (1, 32, 2, 3)
    assert network.encode.weight.shape == (16, 32 * 2 * 3)
    for size in ((32, 40), (0, 16), (8, 16)):
        with pytest.raises(InputError, match="multiples of 16"):
            ConvAutoencoder(size, 4, 16)


def test_prepare_averages_areas():
    image = np.random.default_rng(0).integers(0, 256, (64, 96, 3), dtype=np.uint8)
    out = prepare([image, image[:32, :48]], (32, 48))
    assert out.shape == (2, 3, 32, 48)
    assert out.dtype == torch.float32
    area = image.reshape(32, 2, 48, 2, 3).mean(axis=(1, 3)).transpose(2, 0, 1) / 255
    np.testing.assert_allclose(out[0].numpy(), area, atol=0.51 / 255)
    np.testing.assert_allclose(out[1].numpy(), image[:32, :48].transpose(2, 0, 1) / 255, atol=1e-6)
    assert prepare([], (32, 48)).shape == (0, 3, 32, 48)


def test_weights_of_another_size_are_refused():
    weights = weights_of(ConvAutoencoder(SIZE, 4, 16))
    assert network_with(weights, SIZE).encode.weight.numpy(force=True).tobytes() == weights["encode.weight"].tobytes()
    for given, size in ((weights, (48, 48)), ({}, SIZE), ({**weights, "extra": np.zeros(1)}, SIZE)):
        with pytest.raises(InputError, match="train the map again"):
            network_with(given, size)
