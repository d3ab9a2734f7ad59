"""Trainings against one written out plainly, one beside others against one alone, and a killed one against a whole."""

import threading
from dataclasses import replace

import numpy as np
import pytest
import torch

from fdslam.autoencoder import checkpoint
from fdslam.autoencoder.apart import train_apart
from fdslam.autoencoder.checkpoint import Checkpoints, Forgetful
from fdslam.autoencoder.job import Job
from fdslam.autoencoder.network import ConvAutoencoder
from fdslam.autoencoder.places import fit_places
from fdslam.autoencoder.together import forward, train_together
from fdslam.errors import InputError
from fdslam.store import Store
from tests.autoencoder.scenes import SIZE, SMALL, bytes_of, place
from tests.reference.autoencoder import train_plainly

TRAINERS = [train_apart, train_together]
COUNTS = (7, 1, 5, 9)  # images of places: several batches, a single one, fewer than a batch holds


def jobs(config=SMALL):
    """Trainings of several lengths, some with held-out images."""
    made = []
    for number, count in enumerate(COUNTS):
        images = place(count + 2, seed=number)
        held = images[count:] if number % 2 == 0 else None
        made.append(Job(images[:count], held, config.epochs - (number == 1), (3, number), config))
    return made


def run(train, made, keeper=None):
    train(made, "cpu", keeper or Forgetful(), "test")
    return made


@pytest.mark.parametrize("train", TRAINERS)
def test_every_training_is_the_plain_one(train):
    for job in run(train, jobs()):
        held = job.held
        patience = job.config.patience if held is not None else job.epochs
        losses, held_losses, weights = train_plainly(job.images, held, job.config, job.seed, job.epochs, patience)
        np.testing.assert_allclose(job.losses, losses, rtol=2e-4)
        if held is None:
            assert job.epoch == job.epochs
            for name, value in weights.items():
                # Adam's first steps are signs of gradients: where one is nearly 0, rounding decides.
                assert np.quantile(np.abs(job.weights[name] - value), 0.98) < 1e-4
        else:
            assert job.best[0] == 1 + int(np.argmin(held_losses))
            assert job.best[1] == pytest.approx(min(held_losses), rel=2e-4)
            assert job.outputs.shape == held.shape
            assert float((job.outputs - held).abs().mean()) == pytest.approx(job.best[1], rel=1e-5)


def test_a_group_reconstructs_as_its_networks_do():
    networks = [ConvAutoencoder(SIZE, 4, 16, torch.Generator().manual_seed(i)) for i in range(3)]
    images = torch.rand(3, 2, 3, *SIZE)
    stack = {name: torch.stack([n.state_dict()[name] for n in networks]) for name in networks[0].state_dict()}
    with torch.no_grad():
        expected = torch.stack([network(one) for network, one in zip(networks, images, strict=True)])
        torch.testing.assert_close(forward(stack, images), expected, atol=1e-5, rtol=1e-4)


def state_of(job):
    return {name: array.tobytes() for name, array in job.state().items()}


def test_apart_other_trainings_change_no_byte():
    for together, alone in zip(run(train_apart, jobs()), jobs(), strict=True):
        assert state_of(run(train_apart, [alone])[0]) == state_of(together)


def test_together_other_trainings_change_rounding_alone():
    for together, alone in zip(run(train_together, jobs()), jobs(), strict=True):
        run(train_together, [alone])
        np.testing.assert_allclose(alone.losses, together.losses, rtol=2e-4)
        assert alone.best == (together.best[0], pytest.approx(together.best[1], rel=2e-4))
        assert torch.equal(alone.generator.get_state(), together.generator.get_state())


class Killed(BaseException):
    """What a kill is to a training: nothing after it runs."""


@pytest.mark.parametrize("train", TRAINERS)
@pytest.mark.parametrize("writes", [1, 3, 6])
def test_a_killed_training_goes_on_to_the_same_bytes(train, writes, tmp_path, monkeypatch):
    monkeypatch.setattr(checkpoint, "SECONDS", 0.0)
    monkeypatch.setattr(checkpoint, "SHARE", 0.0)
    config = replace(SMALL, epochs=8, patience=3)
    places = [place(count, seed=i) for i, count in enumerate((6, 1, 4))]
    expected = [bytes_of(m) for m in fit_places(places, config, 0, train=train)]
    store, epochs = Store(tmp_path), []
    original, ended = Store.put, Job.end_epoch

    def put(self, *args):
        original(self, *args)
        put.left -= 1
        if put.left == 0:
            raise Killed

    def end_epoch(self, *args):
        epochs.append(self.seed)
        ended(self, *args)

    put.left = writes
    monkeypatch.setattr(Store, "put", put)
    monkeypatch.setattr(Job, "end_epoch", end_epoch)
    with pytest.raises(Killed):
        fit_places(places, config, 0, train=train, keeper=Checkpoints(store, "a" * 64))
    before = len(epochs)
    keeper = Checkpoints(store, "a" * 64)
    found = [bytes_of(m) for m in fit_places(places, config, 0, train=train, keeper=keeper)]
    assert found == expected
    after = len(epochs) - before
    fit_places(places, config, 0, train=train)
    assert before > 0
    assert before + after == len(epochs) - before - after  # every epoch was trained once
    keeper.clear()
    assert not [*tmp_path.rglob("*.safetensors")]


def test_checkpoints_are_rare_and_a_damaged_one_is_not_used(tmp_path, monkeypatch):
    keeper = Checkpoints(Store(tmp_path), "b" * 64)
    assert not keeper.due("x")
    monkeypatch.setattr(checkpoint, "SECONDS", 0.0)
    keeper = Checkpoints(Store(tmp_path), "b" * 64)
    assert keeper.due("x")
    keeper.save("x", {"a": np.ones(100)})
    [path] = tmp_path.rglob("*.safetensors")
    path.write_bytes(path.read_bytes()[:-9])
    assert keeper.load("x") is None


def test_same_bytes_again_in_parallel_threads_and_without_the_global_generator():
    places = [place(7, seed=1), place(5, seed=2)]
    state = torch.random.get_rng_state()
    expected = [bytes_of(m) for m in fit_places(places, SMALL, seed=3)]
    assert torch.equal(torch.random.get_rng_state(), state)
    torch.manual_seed(99)  # must not matter
    found = {}

    def work(i):
        torch.set_num_threads(1)
        found[i] = bytes_of(fit_places([places[i]], SMALL, seed=3)[0])

    threads = [threading.Thread(target=work, args=(i,)) for i in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [found[0], found[1]] == expected
    assert bytes_of(fit_places(places[:1], SMALL, seed=4)[0]) != expected[0]


@pytest.mark.skipif(not torch.cuda.is_available(), reason="torch finds no CUDA device here")
@pytest.mark.parametrize("train", TRAINERS)
def test_a_gpu_trains_the_same_within_rounding(train):
    for job, expected in zip(jobs(), run(train_apart, jobs()), strict=True):
        train([job], "cuda", Forgetful(), "test")
        np.testing.assert_allclose(job.losses, expected.losses, rtol=5e-3)
        assert job.best[1] == pytest.approx(expected.best[1], rel=5e-3)


def test_early_stop_waits_for_patience_and_keeps_the_best_epoch():
    def stopped(held_losses, epochs=9, patience=2):
        images = place(3)
        job = Job(images[:2], images[2:], epochs, (0, 0), replace(SMALL, patience=patience))
        for loss in held_losses:
            assert not job.finished
            job.end_epoch(0.0, images[2:] + loss)
        return job

    job = stopped([0.5, 0.3, 0.4, 0.35])
    assert job.finished
    assert job.best == (2, pytest.approx(0.3, rel=1e-4))
    torch.testing.assert_close(job.outputs, job.held + 0.3)
    job = stopped([0.5, 0.4, 0.3], epochs=3)
    assert job.finished
    assert job.best[0] == 3
    with pytest.raises(InputError, match="learning_rate"):
        stopped([np.nan] * 3)
