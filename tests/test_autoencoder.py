"""Autoencoders against loops over pixels, the mean-image baseline, and themselves: the same bytes every time."""

from __future__ import annotations

import threading
from dataclasses import replace

import cv2
import numpy as np
import pytest
import torch

from fdslam import autoencoder as ae
from fdslam.config import Autoencoder
from fdslam.errors import InputError
from fdslam.types import CELL
from tests.reference import bilinear, cell_maximum, l1_per_pixel, mean_and_deviation

SMALL = Autoencoder(channels=4, latent=16, epochs=4, patience=2, batch=4, learning_rate=2e-3, folds=3)
SIZE = (32, 48)


@pytest.fixture(autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def place(count, seed=0, height=32, width=48, step=2):
    """A scene seen from ``count`` positions of a path: a textured wall that slides by, ``step`` pixels an image."""
    noise = np.random.default_rng(seed).integers(0, 256, (5, 12, 3), dtype=np.uint8)
    wall = cv2.resize(noise, (2 * width, height), interpolation=cv2.INTER_CUBIC)
    return ae.prepare([wall[:, step * i : step * i + width] for i in range(count)], (height, width))


def bytes_of(model):
    arrays = [model.weights[name] for name in sorted(model.weights)] + [model.training, model.validation]
    return b"".join(a.tobytes() for a in arrays), model.mu, model.sigma, model.epochs, model.own_mu, model.own_sigma


@pytest.fixture(scope="module")
def trained():
    """A place learnt well enough to judge: four images, seen twice so that holding out costs nothing."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    images = place(4, step=14).repeat(2, 1, 1, 1)
    config = replace(SMALL, channels=8, latent=32, epochs=120, patience=60, learning_rate=4e-3, folds=2)
    model = ae.fit_place(images, config, seed=0)
    torch.set_num_threads(before)
    return images, model


@pytest.mark.parametrize("image", [(360, 480), (384, 1024), (1000, 90), (7, 5000), (64, 64)])
@pytest.mark.parametrize("pixels", [1024, 12_288, 60_000])
def test_input_size_is_the_nearest_of_all_multiples_of_16(image, pixels):
    height, width = ae.input_size(*image, pixels)
    sides = np.arange(16, 4097, 16)
    want = [(pixels * image[0] / image[1]) ** 0.5, (pixels * image[1] / image[0]) ** 0.5]
    if min(want) < 16:  # too narrow: the area is kept, the aspect cannot be
        want = [16 if side < 16 else pixels / 16 for side in want]
    assert ae.input_size(360, 480, 12_288) == (96, 128)
    assert [height, width] == [sides[np.abs(sides - side).argmin()] for side in want]


@pytest.mark.parametrize("size", [(16, 16), (32, 48), (96, 128)])
@pytest.mark.parametrize("count", [1, 3])
def test_network_returns_images_of_its_input(size, count):
    images = torch.rand(count, 3, *size, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        out = ae.ConvAutoencoder(size, 4, 16)(images)
    assert out.shape == images.shape
    assert out.dtype == torch.float32
    assert 0 <= out.min() <= out.max() <= 1


def test_network_narrows_to_its_code_and_refuses_other_sizes():
    network = ae.ConvAutoencoder((32, 48), 4, 16)
    assert network.encoder(torch.zeros(1, 3, 32, 48)).shape == (1, 32, 2, 3)
    assert network.encode.weight.shape == (16, 32 * 2 * 3)
    for size in ((32, 40), (0, 16), (8, 16)):
        with pytest.raises(InputError, match="multiples of 16"):
            ae.ConvAutoencoder(size, 4, 16)


def test_prepare_averages_areas():
    image = np.random.default_rng(0).integers(0, 256, (64, 96, 3), dtype=np.uint8)
    out = ae.prepare([image, image[:32, :48]], (32, 48))
    assert out.shape == (2, 3, 32, 48)
    assert out.dtype == torch.float32
    area = image.reshape(32, 2, 48, 2, 3).mean(axis=(1, 3)).transpose(2, 0, 1) / 255
    np.testing.assert_allclose(out[0].numpy(), area, atol=0.51 / 255)
    np.testing.assert_allclose(out[1].numpy(), image[:32, :48].transpose(2, 0, 1) / 255, atol=1e-6)
    assert ae.prepare([], (32, 48)).shape == (0, 3, 32, 48)


def test_augmentation_is_seeded_in_range_and_leaves_its_input_alone():
    images = place(6)
    before = images.clone()
    one, two = (ae.augment(images, torch.Generator().manual_seed(s)) for s in (1, 1))
    assert torch.equal(one, two)
    assert torch.equal(images, before)
    assert one.shape == images.shape
    assert 0 <= one.min() <= one.max() <= 1
    assert not torch.equal(one[0] - images[0], one[1] - images[1])


def test_augmentation_shifts_and_never_mirrors(monkeypatch):
    monkeypatch.setattr(ae, "LIGHT", 0.0)
    ramp = torch.linspace(0.1, 0.9, 48).expand(64, 3, 32, 48)
    out = ae.augment(ramp, torch.Generator().manual_seed(0))
    assert (out.diff(dim=3) >= 0).all()
    step = 0.8 / 47
    moved = ((out - ramp)[:, 0, 16, 24] / step).round().unique().tolist()
    assert moved == list(range(-ae.SHIFT, ae.SHIFT + 1))


@pytest.mark.parametrize(("count", "folds"), [(2, 3), (3, 3), (7, 3), (16, 5), (5, 2)])
def test_folds_are_contiguous_blocks_that_cover_the_place_once(count, folds):
    blocks = ae.fold_slices(count, folds)
    assert len(blocks) == min(count, folds)
    assert [i for b in blocks for i in range(b.start, b.stop)] == list(range(count))
    sizes = [b.stop - b.start for b in blocks]
    assert max(sizes) - min(sizes) <= 1
    assert ae.fold_slices(1, folds) == []


def test_training_beats_the_mean_image(trained):
    images, model = trained
    baseline = float((images - images.mean(dim=0)).abs().mean())
    assert model.own_mu < 0.5 * baseline
    assert model.mu < 0.7 * baseline
    assert model.own_mu == pytest.approx(float(ae.reconstruction_error(model.weights, images).mean()), rel=1e-4)
    assert model.training[-10:].mean() < 0.5 * model.training[:5].mean()
    assert len(model.training) == model.epochs


def test_same_bytes_again_in_parallel_threads_and_without_the_global_generator():
    places = [place(7, seed=1), place(5, seed=2)]
    state = torch.random.get_rng_state()
    expected = [bytes_of(ae.fit_place(images, SMALL, seed=3)) for images in places]
    assert torch.equal(torch.random.get_rng_state(), state)
    torch.manual_seed(99)  # must not matter
    found = {}

    def work(i):
        torch.set_num_threads(1)
        found[i] = bytes_of(ae.fit_place(places[i], SMALL, seed=3))

    threads = [threading.Thread(target=work, args=(i,)) for i in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [found[0], found[1]] == expected
    assert bytes_of(ae.fit_place(places[0], SMALL, seed=4)) != expected[0]


def test_statistics_are_those_of_the_held_out_images(monkeypatch):
    seen = []
    original = ae._fit_fold

    def spy(images, held, config, seed):
        result = original(images, held, config, seed)
        seen.append((held, result))
        return result

    monkeypatch.setattr(ae, "_fit_fold", spy)
    model = ae.fit_place(place(7), SMALL, seed=0)
    assert [h for h, _ in seen] == ae.fold_slices(7, 3)
    mean, deviation = mean_and_deviation(np.concatenate([r[2] for _, r in seen]))
    assert model.mu == pytest.approx(mean)
    assert model.sigma == pytest.approx(deviation)
    assert model.epochs == max(1, round(np.mean([r[0] for _, r in seen])))
    np.testing.assert_allclose(model.validation, [r[1] for _, r in seen])
    np.testing.assert_allclose(model.validation, [r[2].mean() for _, r in seen], rtol=1e-5)


def test_a_held_out_block_is_not_trained_on():
    images = place(6)
    held = slice(4, 6)
    _, _, error = ae._fit_fold(images, held, SMALL, (0, 0))
    assert error.shape == (2, *SIZE)
    changed = images.clone()
    changed[held] = images[held].flip(0)  # the held-out images change places: the training must not notice
    assert ae._fit_fold(changed, held, SMALL, (0, 0))[2].tobytes() == error[::-1].tobytes()
    changed[0] = 1 - images[0]  # and an image that is trained on must count
    assert ae._fit_fold(changed, held, SMALL, (0, 0))[2].tobytes() != error[::-1].tobytes()


def test_early_stop_waits_for_patience_and_keeps_the_best_epoch(monkeypatch):
    losses = iter([0.5, 0.3, 0.4, 0.35, 0.1])
    monkeypatch.setattr(ae, "_error", lambda *_: np.full((1, 2, 2), next(losses), dtype=np.float32))
    epoch, loss, error = ae._fit_fold(place(3), slice(0, 1), replace(SMALL, epochs=9, patience=2), (0, 0))
    assert (epoch, loss) == (2, pytest.approx(0.3))
    assert error.mean() == pytest.approx(0.3)
    losses = iter([0.5, 0.4, 0.3, 0.2])
    assert ae._fit_fold(place(3), slice(0, 1), replace(SMALL, epochs=3, patience=2), (0, 0))[0] == 3
    losses = iter([np.nan] * 4)
    with pytest.raises(InputError, match="learning_rate"):
        ae._fit_fold(place(3), slice(0, 1), replace(SMALL, epochs=9, patience=2), (0, 0))


def test_sigma_has_a_floor():
    assert ae.statistics(np.full((2, 4, 4), 0.25, dtype=np.float32)) == (0.25, ae.SIGMA_FLOOR)
    values = np.random.default_rng(0).random((2, 4, 4)).astype(np.float32)
    assert ae.statistics(values) == pytest.approx(mean_and_deviation(values))


@pytest.mark.parametrize("count", [1, 2])
def test_small_places(count):
    model = ae.fit_place(place(count), SMALL, seed=0)
    assert (model.mu is None) == (model.sigma is None) == (count == 1)
    assert len(model.validation) == (0 if count == 1 else 2)
    assert 1 <= model.epochs <= SMALL.epochs
    assert all(np.isfinite(w).all() and w.dtype == np.float32 for w in model.weights.values())
    assert np.isfinite([model.own_mu, model.own_sigma]).all()
    assert model.own_sigma >= ae.SIGMA_FLOOR


def test_no_image_is_refused():
    with pytest.raises(InputError, match="at least one image"):
        ae.fit_place(torch.empty(0, 3, *SIZE), SMALL, seed=0)


def stub(mu, sigma, own_mu=0.5, own_sigma=0.25):
    return ae.PlaceModel({}, mu, sigma, 1, np.zeros(1, np.float32), np.zeros(0, np.float32), own_mu, own_sigma)


def test_missing_statistics_are_the_mean_of_the_others():
    models = [stub(0.1, 0.01), stub(None, None), stub(0.3, 0.05)]
    filled = ae.fill_statistics(models)
    assert (filled[0], filled[2]) == (models[0], models[2])
    assert (filled[1].mu, filled[1].sigma) == (pytest.approx(0.2), pytest.approx(0.03))
    alone = ae.fill_statistics([stub(None, None, 0.5, 0.25), stub(None, None, 0.4, 0.2)])
    assert [(m.mu, m.sigma) for m in alone] == [(0.5, 0.25), (0.4, 0.2)]
    assert ae.fill_statistics([]) == ()


def test_error_equals_a_loop_over_pixels_and_does_not_depend_on_the_batch(trained):
    images, model = trained
    network = ae.ConvAutoencoder(SIZE, 8, 32)
    network.load_state_dict({name: torch.from_numpy(value) for name, value in model.weights.items()})
    with torch.no_grad():
        expected = l1_per_pixel(images[:2].numpy(), network(images[:2]).numpy())
    errors = ae.reconstruction_error(model.weights, images)
    assert errors.dtype == np.float32
    np.testing.assert_allclose(errors[:2], expected, atol=1e-5)
    for i in (0, 5):
        assert ae.reconstruction_error(model.weights, images[i : i + 1]).tobytes() == errors[i : i + 1].tobytes()
    assert ae.reconstruction_error(model.weights, images[:0]).shape == (0, *SIZE)


def test_weights_of_another_size_are_refused(trained):
    _, model = trained
    for weights, size in ((model.weights, (48, 48)), ({}, SIZE), ({**model.weights, "extra": np.zeros(1)}, SIZE)):
        with pytest.raises(InputError, match="train the map again"):
            ae.reconstruction_error(weights, torch.zeros(1, 3, *size))


def test_a_patch_that_was_never_seen_has_the_larger_error(trained):
    images, model = trained
    for i, (y, x) in enumerate([(4, 6), (16, 30), (10, 20)]):
        changed = images[i : i + 1].clone()
        changed[:, :, y : y + 10, x : x + 10] = 1 - changed[:, :, y : y + 10, x : x + 10].round()
        error = ae.reconstruction_error(model.weights, changed)[0]
        inside = np.zeros(SIZE, dtype=bool)
        inside[y : y + 10, x : x + 10] = True
        assert error[inside].mean() > 2 * error[~inside].mean()


def test_z_is_the_definition_and_a_shared_c_cannot_change_a_ranking():
    rng = np.random.default_rng(0)
    errors = rng.random((3, 4, 5)).astype(np.float32)
    mus, sigmas = (0.2, 0.4, 0.3), (0.1, 0.2, 0.05)
    scores = np.stack([ae.z_score(e, m, s) for e, m, s in zip(errors, mus, sigmas, strict=True)])
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
    cells = ae.error_to_cells(error, height, width)
    assert cells.dtype == np.float32
    np.testing.assert_allclose(cells, cell_maximum(bilinear(error, height, width), CELL), atol=1e-4)
