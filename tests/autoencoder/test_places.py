"""Places: cross-fitting against loops over folds, the mean-image baseline, and statistics against exact sums."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from fdslam.autoencoder.apart import train_apart
from fdslam.autoencoder.places import PlaceModel, fill_statistics, fit_places, fold_slices
from fdslam.autoencoder.scoring import SIGMA_FLOOR, reconstruction_error
from fdslam.autoencoder.together import train_together
from fdslam.errors import InputError
from tests.autoencoder.scenes import SIZE, SMALL, place
from tests.reference import mean_and_deviation


@pytest.fixture(scope="module")
def trained():
    """A place learnt well enough to judge: four images, seen twice so that holding out costs nothing."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    images = place(4, step=14).repeat(2, 1, 1, 1)
    config = replace(SMALL, channels=8, latent=32, epochs=120, patience=60, learning_rate=4e-3, folds=2)
    [model] = fit_places([images], config, seed=0)
    torch.set_num_threads(before)
    return images, model


@pytest.mark.parametrize(("count", "folds"), [(2, 3), (3, 3), (7, 3), (16, 5), (5, 2)])
def test_folds_are_contiguous_blocks_that_cover_the_place_once(count, folds):
    blocks = fold_slices(count, folds)
    assert len(blocks) == min(count, folds)
    assert [i for b in blocks for i in range(b.start, b.stop)] == list(range(count))
    sizes = [b.stop - b.start for b in blocks]
    assert max(sizes) - min(sizes) <= 1
    assert fold_slices(1, folds) == []


def test_training_beats_the_mean_image(trained):
    images, model = trained
    baseline = float((images - images.mean(dim=0)).abs().mean())
    assert model.own["l1"][0] < 0.5 * baseline
    assert model.held_out["l1"][0] < 0.7 * baseline
    found = float(reconstruction_error(model.weights, images).mean())
    assert model.own["l1"][0] == pytest.approx(found, rel=1e-4)
    assert model.training[-10:].mean() < 0.5 * model.training[:5].mean()
    assert len(model.training) == model.epochs


@pytest.mark.parametrize("kind", ["l1", "ssim", "gradient"])
def test_a_patch_that_was_never_seen_has_the_larger_error(trained, kind):
    images, model = trained
    for i, (y, x) in enumerate([(4, 6), (16, 30), (10, 20)]):
        changed = images[i : i + 1].clone()
        changed[:, :, y : y + 10, x : x + 10] = 1 - changed[:, :, y : y + 10, x : x + 10].round()
        error = reconstruction_error(model.weights, changed, kind=kind)[0]
        inside = np.zeros(SIZE, dtype=bool)
        inside[y : y + 10, x : x + 10] = True
        assert error[inside].mean() > 1.5 * error[~inside].mean()


def test_statistics_are_those_of_the_held_out_images():
    seen = []

    def spy(jobs, *args):
        train_apart(jobs, *args)
        seen.append(jobs)

    images = place(7)
    [model] = fit_places([images], SMALL, seed=0, train=spy)
    folds, finals = seen
    assert torch.equal(torch.cat([job.held for job in folds]), images)
    for job in folds:  # what is held out is not trained on
        assert len(job.images) + len(job.held) == 7
        assert not any(torch.equal(a, b) for a in job.images for b in job.held)
    errors = torch.cat([(job.outputs - job.held).abs().mean(dim=1) for job in folds]).numpy()
    mean, deviation = mean_and_deviation(errors)
    assert model.held_out["l1"] == (pytest.approx(mean), pytest.approx(deviation))
    assert model.held_out.keys() == {"l1", "ssim", "gradient"}
    assert model.epochs == max(1, round(np.mean([job.best[0] for job in folds])))
    assert [job.images is images for job in finals] == [True]
    np.testing.assert_allclose(model.validation, [job.best[1] for job in folds])


@pytest.mark.parametrize("train", [train_apart, train_together])
@pytest.mark.parametrize("counts", [(1,), (2, 1), (1, 1)])
def test_small_places(counts, train):
    models = fit_places([place(count) for count in counts], SMALL, seed=0, train=train)
    for count, model in zip(counts, models, strict=True):
        assert (model.held_out == {}) == (count == 1)
        assert len(model.validation) == (0 if count == 1 else 2)
        assert 1 <= model.epochs <= SMALL.epochs
        assert all(np.isfinite(w).all() and w.dtype == np.float32 for w in model.weights.values())
        assert np.isfinite([*model.own.values()]).all()
        assert min(sigma for _, sigma in model.own.values()) >= SIGMA_FLOOR


def test_no_image_is_refused():
    with pytest.raises(InputError, match="at least one image"):
        fit_places([place(2), torch.empty(0, 3, *SIZE)], SMALL, seed=0)


def stub(held_out, own=(0.5, 0.25)):
    nothing = np.zeros(0, np.float32)
    return PlaceModel({}, {"l1": held_out} if held_out else {}, {"l1": own}, 1, nothing, nothing)


def test_missing_statistics_are_the_mean_of_the_others():
    models = [stub((0.1, 0.01)), stub(None), stub((0.3, 0.05))]
    filled = fill_statistics(models)
    assert (filled[0], filled[2]) == (models[0], models[2])
    assert filled[1].held_out == {"l1": (pytest.approx(0.2), pytest.approx(0.03))}
    alone = fill_statistics([stub(None, (0.5, 0.25)), stub(None, (0.4, 0.2))])
    assert [m.held_out["l1"] for m in alone] == [(0.5, 0.25), (0.4, 0.2)]
    assert fill_statistics([]) == ()


@pytest.mark.parametrize("train", [train_apart, train_together])
@pytest.mark.parametrize(("count", "epochs"), [(1, 4), (1, 1), (5, 1)])
def test_a_diverging_training_names_its_place_and_the_way_out(train, count, epochs):
    config = replace(SMALL, epochs=epochs)
    config.learning_rate = 1e30  # what the schema refuses; in one epoch of one step no loss has seen the weights yet
    with pytest.raises(InputError, match=r"of the quad diverged in epoch [12]: ad.learning_rate=1e\+30 is too high"):
        fit_places([place(count)], config, 0, train=train, names=["the quad"])


@pytest.mark.parametrize("spoilt", ["loss", "weights"])
def test_what_is_not_finite_is_never_a_model(monkeypatch, spoilt):
    def train(jobs, device, keeper, name):
        train_apart(jobs, device, keeper, name)
        if spoilt == "weights":
            jobs[1].weights["decoder.7.bias"][0] = np.inf  # a white output: every loss is finite
        else:
            jobs[1].losses.pop()
            jobs[1].end_epoch(np.nan, None)

    with pytest.raises(InputError, match="of place 1 diverged in epoch 4"):
        fit_places([place(1), place(1, 1)], SMALL, 0, train=train)
