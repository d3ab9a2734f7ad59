"""Stored places: what is trained, when, and from where a killed training goes on."""

from dataclasses import replace

import numpy as np
import pytest

from fdslam import place_models
from fdslam.autoencoder import checkpoint
from fdslam.config import Ad, Config, Folder
from fdslam.context import Context
from fdslam.data.folder import read_folder
from fdslam.detectors import anomaly
from fdslam.errors import InputError
from fdslam.place_models import MODEL, trained_places, untrained
from fdslam.store import Store
from fdslam.types import Boxes, Localization
from tests.autoencoder.scenes import bytes_of
from tests.data.worlds import small_world

QUICK = Ad(k=2, epochs=3, folds=2, channels=4, latent=8, pixels=1024)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    root = small_world(tmp_path_factory.mktemp("world"))
    return read_folder(root, Folder(root=str(root)))


def context_of(data, folder, seed=0, **changes):
    config = Config(ad=replace(QUICK, **changes), workers=1, store=str(folder), seed=seed)
    queries = len(data.query)
    nothing = Boxes(np.zeros((0, 4), np.float32), ())
    library = Boxes(np.array([[0, 0, 9, 9], [5, 0, 30, 40]], np.float32), ("J", "J"))
    found = Localization(nothing, np.ones((0, len(data.map))), np.arange(len(data.map), dtype=np.int32), library)
    top = tuple(np.array([q % len(data.map), (q + 1) % len(data.map)]) for q in range(queries))
    return Context(config, data, Store(folder), (found,) * queries, ("",) * queries, top)


@pytest.mark.parametrize("train", ["together", "apart"])
def test_what_is_stored_is_not_trained_again(data, tmp_path, train, monkeypatch):
    context = context_of(data, tmp_path, train=train)
    assert untrained(context) == len(data.map)
    first = trained_places(context)
    assert untrained(context) == 0
    assert sorted(set(first.label.tolist())) == [*range(len(first.models))]
    assert all(model.held_out for model in first.models)
    assert not (tmp_path / checkpoint.STAGE.name).exists() or not [*(tmp_path / checkpoint.STAGE.name).rglob("*.s*")]
    with monkeypatch.context() as patched:
        patched.setattr(place_models, "fit_places", None)
        again = trained_places(context)
    assert [*map(bytes_of, again.models)] == [*map(bytes_of, first.models)]
    context.store.path(MODEL, first.keys[0]).unlink()
    lost = int((first.label == 0).sum())
    assert untrained(context) == (len(data.map) if train == "together" else lost)
    assert [*map(bytes_of, trained_places(context).models)] == [*map(bytes_of, first.models)]


def test_together_and_apart_agree_and_are_told_apart(data, tmp_path):
    together, apart = (trained_places(context_of(data, tmp_path, train=t)) for t in ("together", "apart"))
    assert not {*together.keys} & {*apart.keys}
    for one, other in zip(together.models, apart.models, strict=True):
        assert one.epochs == other.epochs
        np.testing.assert_allclose(one.training, other.training, rtol=1e-3)
        for kind, moments in one.held_out.items():
            assert moments == pytest.approx(other.held_out[kind], rel=1e-2)


def test_together_the_address_names_all_that_is_trained_beside(data, tmp_path):
    fewer = replace(data, map=data.map[:-1])

    def keys(of, train):
        context = context_of(of, tmp_path, train=train)
        label = np.arange(len(of.map)) >= 2  # the first place is the same in both
        return place_models._members(context, label.astype(np.int64))[1]

    assert keys(data, "apart")[0] == keys(fewer, "apart")[0]
    assert keys(data, "together")[0] != keys(fewer, "together")[0]


@pytest.mark.parametrize("train", ["together", "apart"])
def test_a_killed_run_goes_on_from_its_checkpoints(data, tmp_path, train, monkeypatch):
    expected = [bytes_of(m) for m in trained_places(context_of(data, tmp_path / "whole", train=train)).models]
    monkeypatch.setattr(checkpoint, "SECONDS", 0.0)
    monkeypatch.setattr(checkpoint, "SHARE", 0.0)
    put, killed = Store.put, []

    def kill(self, stage, *args):
        put(self, stage, *args)
        if stage is checkpoint.STAGE:
            killed.append(stage)
            if len(killed) == 4:
                raise KeyboardInterrupt

    context = context_of(data, tmp_path / "killed", train=train)
    with monkeypatch.context() as patched:
        patched.setattr(Store, "put", kill)
        with pytest.raises(KeyboardInterrupt):
            trained_places(context)
    assert [*(tmp_path / "killed" / checkpoint.STAGE.name).rglob("*.safetensors")]
    assert [bytes_of(m) for m in trained_places(context).models] == expected
    assert not [*(tmp_path / "killed" / checkpoint.STAGE.name).rglob("*.safetensors")]


def test_the_model_is_stored_before_its_checkpoints_go(data, tmp_path, monkeypatch):
    stored = []
    monkeypatch.setattr(
        checkpoint.Checkpoints, "clear", lambda self: stored.append(self.store.has(MODEL, self.key)), raising=True
    )
    trained_places(context_of(data, tmp_path, train="apart"))
    trained_places(context_of(data, tmp_path, train="together"))
    assert stored == [True] * 3


@pytest.mark.parametrize("hypotheses", ["top1", "min"])
@pytest.mark.parametrize("region", ["pixel", "obb"])
@pytest.mark.parametrize("error", ["l1", "ssim", "gradient"])
def test_variants_share_the_models_and_give_scores_of_their_own(data, tmp_path_factory, error, region, hypotheses):
    folder = tmp_path_factory.getbasetemp() / "variants"
    plain = anomaly.detect(context_of(data, folder))
    context = context_of(data, folder, error=error, region=region, hypotheses=hypotheses)
    assert untrained(context) == 0
    found = anomaly.detect(context)
    assert all(a.shape == b.shape and np.isfinite(a).all() for a, b in zip(found.loc, plain.loc, strict=True))
    same = all(np.array_equal(a, b) for a, b in zip(found.loc, plain.loc, strict=True))
    assert same == ((error, region) == ("l1", "pixel") and (hypotheses == "top1" or same))
    if (region, hypotheses) == ("obb", "top1"):  # what no OBB covers has the z of no error at all
        models = trained_places(context)
        for query, loc in enumerate(found.loc):
            mu, sigma = models.models[models.label[context.hypotheses[query][0]]].held_out[error]
            assert loc[-1, -1] == pytest.approx(-mu / sigma / 0.8, rel=1e-5)
    if hypotheses == "min":
        one = anomaly.detect(context_of(data, folder, error=error, region=region))
        assert all((a <= b).all() for a, b in zip(found.loc, one.loc, strict=True))
    assert anomaly.missing(context) == 0


def test_a_query_reads_the_models_of_its_places_alone_and_each_once(data, tmp_path, monkeypatch):
    context = context_of(data, tmp_path, hypotheses="min")
    label = trained_places(context).label
    first, second = (np.flatnonzero(label == place) for place in (0, 1))
    asked = replace(context, hypotheses=(first[:1],) * len(data.query))
    read, get = [], Store.get
    monkeypatch.setattr(Store, "get", lambda *args: read.append(args[1:]) or get(*args))
    anomaly.detect(asked)
    keys = trained_places(context).keys
    assert [key for stage, key in read if stage is MODEL] == [keys[0]]
    read.clear()
    anomaly.detect(asked)  # all is stored
    assert not [key for stage, key in read if stage is MODEL]
    anomaly.detect(replace(context, hypotheses=(np.array([first[0], second[0]]),) * len(data.query)))
    assert sorted(key for stage, key in read if stage is MODEL) == sorted(keys)


@pytest.mark.parametrize("train", ["together", "apart"])
def test_a_damaged_model_is_made_again_when_it_is_asked_for(data, tmp_path, train):
    context = context_of(data, tmp_path / "damaged", train=train)
    whole = trained_places(context_of(data, tmp_path / "whole", train=train))
    expected = [*map(bytes_of, whole.models)]
    keys = trained_places(context).keys
    path = context.store.path(MODEL, keys[1])
    torn = bytearray(path.read_bytes())
    torn[-1] ^= 1
    path.write_bytes(torn)
    found = trained_places(context)
    assert path.read_bytes() == torn  # nobody has asked for it
    assert [*map(bytes_of, found.models)] == expected
    assert context.store.has(MODEL, keys[1])
    assert [*map(bytes_of, trained_places(context).models)] == expected
    assert found.held_out == tuple(model.held_out for model in whole.models)
    assert found.nbytes == sum(w.nbytes for model in whole.models for w in model.weights.values())


def test_a_model_trained_anew_has_its_statistics_measured_anew(data, tmp_path):
    context = context_of(data, tmp_path)
    found = trained_places(context)
    address = place_models.SUMMARY.key({}, found.keys)
    context.store.path(MODEL, found.keys[0]).unlink()
    wrong = {name: np.asarray(array + 1) for name, array in context.store.get(place_models.SUMMARY, address).items()}
    context.store.put(place_models.SUMMARY, address, wrong)
    assert trained_places(context).held_out == found.held_out


def test_one_place_of_one_image_has_the_means_of_the_others(data, tmp_path):
    context = context_of(data, tmp_path, k=len(data.map))
    found = trained_places(context)
    assert [*found.held_out] == [model.held_out for model in found.models]
    assert [*trained_places(context).held_out] == [*found.held_out]


def test_a_message_names_the_place_by_its_images(data, tmp_path):
    context = context_of(data, tmp_path)
    context.config.ad.learning_rate = 1e30
    context.config.ad.epochs = 1
    message = rf"place \d \(\d map images, the first {data.map[0].name.split('/')[0]}.* is too high"
    with pytest.raises(InputError, match=message):
        trained_places(context)
