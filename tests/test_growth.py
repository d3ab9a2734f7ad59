"""Maps that grow and keep what they learned. Its oracle is a fit, and the pipeline, with ``compact.learned``."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from fdslam import ChangeDetector
from fdslam.compact import map as compact_map
from fdslam.compact import training
from fdslam.config import Folder
from fdslam.data.images import read_image
from fdslam.errors import InputError
from fdslam.pipeline import run
from fdslam.provenance import Stopwatch
from tests.compact.walks import walk
from tests.test_api import files, made, same

LEARNED = ["compact.learned=6"]


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

    return forbid


@pytest.mark.parametrize("row", ["FD", "CC", "FD+CC+EF"])
def test_a_map_grows_from_memory_and_keeps_what_it_learned(row, world, no_learning, tmp_path):
    images, queries = files(world / "map"), files(world / "query")
    at_once = made(row, None, more=LEARNED).fit(images)
    expected = [at_once.detect(query) for query in queries]
    grown = made(row, None).fit([read_image(path) for path in images[:6]])
    no_learning()
    for few in (images[6:7], images[7:]):
        grown.update([read_image(path) for path in few], learn=False)
    assert len(grown) == 10
    assert grown.config.compact.learned == 6
    grown.save(tmp_path / "map")
    again = ChangeDetector.load(tmp_path / "map")
    assert again.config.compact.learned == 6
    for query, one in zip(queries, expected, strict=True):
        assert np.array_equal(grown.detect(query).cells, one.cells)
        same(again.detect(query), grown.detect(query))
        assert np.array_equal(one.localization.ranks, again.detect(query).localization.ranks)


def test_the_pipeline_finds_the_same(world, tmp_path):
    images = files(world / "map")
    grown = made("FD+CC+EF", None).fit(images[:6]).update(images[6:], learn=False)
    config = replace(grown.config, dataset=Folder(root=str(world)), store=str(tmp_path / "store"))
    outcome = run(config, Stopwatch())
    for one, cells in zip(grown.detect_all(files(world / "query")), outcome.maps["FD+CC+EF"], strict=True):
        assert np.array_equal(one.cells, cells)
    everything = run(replace(config, compact=replace(config.compact, learned=0)), Stopwatch())
    for row in ("CC", "EF"):  # it does matter what is learned from
        assert any(not np.array_equal(*pair) for pair in zip(everything.maps[row], outcome.maps[row], strict=True))


def test_a_loaded_map_learns_again_from_all_if_asked(world, tmp_path):
    shutil.copytree(world / "map", tmp_path / "photos")
    photos, query = files(tmp_path / "photos"), files(world / "query")[1]
    made("EF", None).fit(photos[:6]).update(photos[6:8], learn=False).save(tmp_path / "map")
    again = ChangeDetector.load(tmp_path / "map").update(photos[8:])
    assert again.config.compact.learned == 0
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


def test_places_cannot_keep_what_they_learned(world):
    images = files(world / "map")
    detector = made("AD", None).fit(images[:6])
    with pytest.raises(InputError, match="update: AD must learn from all map images again; fit them all anew"):
        detector.update(images[6:], learn=False)
    assert len(detector) == 6


@pytest.mark.parametrize("row", ["CC", "EF"])
def test_a_map_cannot_learn_from_more_images_than_it_has(row, world):
    with pytest.raises(InputError, match=r"compact\.learned=11: the map has 10 images; name at most as many, or 0"):
        made(row, None, more=["compact.learned=11"]).fit(world / "map")
