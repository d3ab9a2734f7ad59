"""Maps that grow and keep what they learned. Its oracle is a fit, and the pipeline, with ``learned``."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from fdslam import ChangeDetector, place_models
from fdslam.compact import map as compact_map
from fdslam.compact import training
from fdslam.config import Campus, Compact, Early, Evaluation, Folder, Mix, Obb
from fdslam.context import Context
from fdslam.data import load_datasets, outline_of
from fdslam.data.images import read_image
from fdslam.errors import InputError
from fdslam.mapping import BowMap
from fdslam.models import load_models
from fdslam.obb import Library
from fdslam.pipeline import run
from fdslam.provenance import Stopwatch
from fdslam.report.tables import summary
from fdslam.store import Store
from fdslam.todo import Todo, everything, remaining
from tests.compact.walks import config_for, walk
from tests.test_api import files, made, same
from tests.test_pipeline import config_for as campus_config

LEARNED = ["learned=6"]


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    return walk(tmp_path_factory.mktemp("world"), count=10)


@pytest.fixture
def no_learning(monkeypatch):
    """A function after whose call whatever is learned is an error."""

    def forbid():
        def learn(*_):
            raise AssertionError("it learns again")

        monkeypatch.setattr(training, "boosted", learn)
        monkeypatch.setattr(training, "pseudo_rows", learn)
        monkeypatch.setattr(compact_map, "centring", learn)
        monkeypatch.setattr(place_models, "place_classes", learn)
        monkeypatch.setattr(place_models, "fit_places", learn)

    return forbid


@pytest.mark.parametrize("row", ["FD", "CC", "FD+CC+EF", "AD"])
def test_a_map_grows_from_memory_and_keeps_what_it_learned(row, world, no_learning, tmp_path):
    images, queries = files(world / "map"), files(world / "query")
    at_once = made(row, None, more=LEARNED).fit(images)
    expected = [at_once.detect(query) for query in queries]
    grown = made(row, None).fit([read_image(path) for path in images[:6]])
    no_learning()
    for few in (images[6:7], images[7:]):
        grown.update([read_image(path) for path in few], learn=False)
    assert len(grown) == 10
    assert grown.config.learned == 6
    grown.save(tmp_path / "map")
    again = ChangeDetector.load(tmp_path / "map")
    assert again.config.learned == 6
    for query, one in zip(queries, expected, strict=True):
        assert np.array_equal(grown.detect(query).cells, one.cells)
        same(again.detect(query), grown.detect(query))
        assert np.array_equal(one.localization.ranks, again.detect(query).localization.ranks)


def test_the_pipeline_finds_the_same(world, tmp_path):
    images = files(world / "map")
    grown = made("FD+AD+CC+EF", None).fit(images[:6]).update(images[6:], learn=False)
    config = replace(grown.config, dataset=Folder(root=str(world)), store=str(tmp_path / "store"))
    outcome = run(config, Stopwatch())
    for one, cells in zip(grown.detect_all(files(world / "query")), outcome.maps["FD+AD+CC+EF"], strict=True):
        assert np.array_equal(one.cells, cells)
    assert summary(outcome, config)[1].endswith("viewpoint predicted, learned from the first 6 map images")
    from_all = replace(config, learned=0)
    of_all = run(from_all, Stopwatch())
    assert summary(of_all, from_all)[1].endswith("viewpoint predicted")
    for row in ("AD", "CC", "EF"):  # it does matter what is learned from
        assert any(not np.array_equal(*pair) for pair in zip(of_all.maps[row], outcome.maps[row], strict=True))


def test_a_loaded_map_learns_again_from_all_if_asked(world, tmp_path):
    shutil.copytree(world / "map", tmp_path / "photos")
    photos, query = files(tmp_path / "photos"), files(world / "query")[1]
    made("EF", None).fit(photos[:6]).update(photos[6:8], learn=False).save(tmp_path / "map")
    again = ChangeDetector.load(tmp_path / "map").update(photos[8:])
    assert again.config.learned == 0
    same(again.detect(query), made("EF", None).fit(photos).detect(query))
    shutil.rmtree(tmp_path / "photos")
    loaded = ChangeDetector.load(tmp_path / "map")
    before = loaded.detect(query)
    new = read_image(files(world / "map")[8])
    with pytest.raises(
        InputError, match=r"update: EF learn from all map .* 8 are gone.*keep what was learned with learn=False"
    ):
        loaded.update([new])
    same(loaded.detect(query), before)
    assert len(loaded.update([new], learn=False)) == 9


@pytest.mark.parametrize("row", ["FD", "CC", "EF", "AD"])
def test_a_map_cannot_learn_from_more_images_than_it_has(row, world):
    with pytest.raises(InputError, match=r"learned=11: the map has 10 images; name at most as many, or 0"):
        made(row, None, more=["learned=11"]).fit(world / "map")


def test_a_map_of_obb_documents_grows_without_its_photos(world, tmp_path):
    shutil.copytree(world / "map", tmp_path / "photos")
    documents = ["bow.document=obb", "obb.library=J+B+BING"]
    expected = made("FD", None, more=[*documents, *LEARNED]).fit(world / "map")
    photos = files(tmp_path / "photos")
    made("FD", None, more=documents).fit(photos[:6]).save(tmp_path / "map")
    for photo in photos[:6]:
        photo.unlink()
    grown = ChangeDetector.load(tmp_path / "map").update(photos[6:], learn=False)
    for query in files(world / "query"):
        assert np.array_equal(grown.detect(query).cells, expected.detect(query).cells)


def test_what_the_settings_say_is_learned_from_stays(world, no_learning, tmp_path):
    images = [read_image(path) for path in files(world / "map")]
    grown = made("EF", None, more=LEARNED).fit(images[:8])
    no_learning()
    grown.update(images[8:])  # from all that the settings name
    assert (len(grown), grown.config.learned) == (10, 6)
    grown.save(tmp_path / "map")
    for other in (4, 0):  # a setting goes before what was saved, and that map is another
        with pytest.raises(InputError, match="is damaged, or was saved with other settings"):
            ChangeDetector.load(tmp_path / "map", [f"learned={other}"])


@pytest.mark.parametrize("value", ["Infinity", "1e999", "true", "3.7", '"6"', "null", "-1", "11"])
def test_a_manifest_that_says_nonsense_of_it_is_one_line(value, world, tmp_path):
    made("FD", None).fit(world / "map").save(tmp_path / "map")
    manifest = tmp_path / "map" / "map.json"
    text = manifest.read_text()
    assert '"learned": 0' in text
    manifest.write_text(text.replace('"learned": 0', f'"learned": {value}'))
    with pytest.raises(InputError, match=r"map\.json: cannot be read as a saved map \(learned from"):
        ChangeDetector.load(tmp_path / "map")
    older = text.replace('"learned": 0', '"else": 0')  # before it was written
    manifest.write_text(older)
    assert ChangeDetector.load(tmp_path / "map").config.learned == 0


def test_the_map_as_it_was_is_that_of_its_images(world, tmp_path):
    config, store = config_for(world, tmp_path), Store(tmp_path)
    [data] = load_datasets(config.dataset, store, 1)
    whole, few = (BowMap(data.map[:n], config.bow, Library(config.obb), store, 1) for n in (10, 4))
    whole.kept_places()  # what it knows of all its images is not what it knew of four
    then = whole.first(4)
    assert (then.frames, then.keys, then.identity, then.file) == (few.frames, few.keys, few.identity, few.file)
    assert then.kept_places() == few.kept_places()
    assert (then.bag.index.images, whole.bag.index.images) == (4, 10)
    poses = np.arange(30.0).reshape(10, 3)
    context = Context(replace(config, learned=4), replace(data, poses=poses), store, (), (), (), whole)
    learned = context.learned()
    assert learned.dataset.map == data.map[:4]
    assert np.array_equal(learned.dataset.poses, poses[:4])
    assert np.array_equal(learned.dataset.times, data.times[:4])
    assert learned.learned() is learned  # all of these
    assert replace(context, config=config).learned().dataset.map == data.map


def test_the_estimate_knows_what_is_learned_from_and_counts_a_map_once(tmp_path):
    small = Campus(images=24, width=154, height=202, objects=24, distractors=24, all_pairs=True)
    learner = Early(model="map", images=2, trees=5, leaves=4)
    config = campus_config(
        small, tmp_path, mix=Mix(rows=["EF", "AD"]), evaluation=Evaluation(bootstrap=20), early=learner,
        compact=Compact(source="gradients"), learned=4, obb=Obb("J+B"),
    )  # fmt: skip

    def todo():
        store = Store(config.store)
        data, looks = load_datasets(config.dataset, store, 1), load_models(config).looks
        return remaining(config, data, Library(config.obb), None, store, looks)

    sizes = outline_of(config.dataset, Store(tmp_path))
    assert sizes.maps == (6, 6, 6, 6)
    at_first, loaded = everything(config, sizes), todo()
    assert (at_first.pretend, at_first.train) == (loaded.pretend, loaded.train) == (8, 16)
    run(config, Stopwatch())
    assert len(list((tmp_path / "pseudo_query").rglob("*.safetensors"))) == 8
    assert todo() == Todo()
