"""Augmentation against slices and the formula of its light, written out."""

import numpy as np
import torch

from fdslam.autoencoder.augmentation import LIGHT, SHIFT, augment, draw
from tests.autoencoder.scenes import place


def test_parameters_are_seeded_and_in_range():
    one, two = (draw(500, torch.Generator().manual_seed(1)) for _ in range(2))
    assert torch.equal(one, two)
    assert one.shape == (500, 5)
    assert sorted(set(one[:, :2].flatten().tolist())) == list(range(-SHIFT, SHIFT + 1))
    assert one[:, 2:].min() < -0.9
    assert one[:, 2:].max() > 0.9
    assert one[:, 2:].abs().max() <= 1
    state = torch.random.get_rng_state()
    augment(place(2), draw(2, torch.Generator().manual_seed(1)))
    assert torch.equal(torch.random.get_rng_state(), state)


def test_every_shift_equals_a_slice_of_the_repeated_border():
    images = place(9)
    shifts = torch.tensor([[x, y, 0.0, 0, 0] for x in (-1, 0, 1) for y in (-1, 0, 1)])
    padded = np.pad(images.numpy(), ((0, 0), (0, 0), (1, 1), (1, 1)), mode="edge")
    before = images.clone()
    out = augment(images, shifts)
    assert torch.equal(images, before)
    for i, (x, y) in enumerate(shifts[:, :2].int().tolist()):
        np.testing.assert_allclose(out[i], padded[i, :, 1 - y : 33 - y, 1 - x : 49 - x].clip(1e-3), atol=2e-6)


def test_light_equals_its_formula():
    images = place(6)
    parameters = draw(6, torch.Generator().manual_seed(3))
    parameters[:, :2] = 0
    gamma, contrast, brightness = LIGHT * parameters[:, 2:].double().numpy().T[:, :, None, None, None]
    power = np.maximum(images.double().numpy(), 1e-3) ** np.exp(3 * gamma)
    expected = ((power - 0.5) * (1 + contrast) + 0.5 + brightness / 2).clip(0, 1)
    np.testing.assert_allclose(augment(images, parameters), expected, atol=1e-5)


def test_an_image_is_what_it_is_beside_any_others():
    images, parameters = place(7), draw(7, torch.Generator().manual_seed(2))
    whole = augment(images, parameters)
    for some in (slice(0, 1), slice(2, 5), slice(6, 7)):
        assert torch.equal(augment(images[some], parameters[some]), whole[some])
