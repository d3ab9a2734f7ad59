"""What a run says it will take. The oracle is what a run then leaves in its store."""

import logging
import shutil
from dataclasses import replace

import pytest

from experiments.table1.campus_as_nclt import write_campus
from fdslam import estimate as module
from fdslam.config import Campus, Evaluation, Mix, Nclt, Report
from fdslam.data import load_datasets, outline, outline_of
from fdslam.errors import InputError
from fdslam.estimate import check_room, estimate, everything, remaining, warn_of_memory
from fdslam.obb import Library
from fdslam.pipeline import run
from fdslam.provenance import Stopwatch
from fdslam.store import Store
from tests.test_pipeline import config_for

SMALL = Campus(images=24, width=154, height=202, objects=24, distractors=24, all_pairs=True)
NONE = {"make": 0, "features": 0, "learn": 0, "localise": 0, "sift": 0, "train": 0, "look": 0}


def stored(store, stage):
    return len(list((store / stage).rglob("*.safetensors")))


def todo(config):
    store = Store(config.store)
    return vars(remaining(config, load_datasets(config.dataset, store, 1), Library(config.obb), store))


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A configuration, what was to do before its run, and its store after it."""
    store = tmp_path_factory.mktemp("estimate") / "store"
    config = config_for(SMALL, store, mix=Mix(rows=["FD", "PC", "AD"]), evaluation=Evaluation(bootstrap=20))
    sizes = outline_of(config.dataset, Store(store))
    before = vars(everything(sizes))
    outcome = run(config, Stopwatch())
    return config, sizes, before, outcome, store


def test_what_is_to_do_at_first_is_what_a_run_then_makes(done):
    _, sizes, before, outcome, store = done
    assert before["make"] == sizes.missing == sizes.images == stored(store, "campus_view") == 24
    assert before["features"] == stored(store, "features") == 24
    assert before["learn"] == stored(store, "vocabulary") == 24
    assert before["train"] == 24
    assert sizes.maps == (6, 6, 6, 6)
    # of queries and of images that are compared it is at most so many
    assert before["localise"] >= len(outcome.dataset.query) == stored(store, "localization") > 12
    assert before["sift"] >= stored(store, "pc_features") > 12
    loaded = outline([one.dataset for one in outcome.pairs])
    assert replace(sizes, missing=0, pairs=()) == replace(loaded, pairs=(), images=24)
    assert [m for _, m in sizes.pairs] == [m for _, m in loaded.pairs]


def test_nothing_is_to_do_after_a_run(done):
    config, *_ = done
    assert outline_of(config.dataset, Store(config.store)).missing == 0
    assert todo(config) == NONE


@pytest.mark.parametrize(
    ("stage", "less", "expected"),
    [
        ("features", 5, {"features": 5}),
        ("localization", 3, {"localise": 3}),
        ("map", 4, {}),  # words of the images are stored: nothing is learned again
        ("places", 1, {"train": 6}),
    ],
)
def test_what_is_lost_is_to_do_again(done, tmp_path, stage, less, expected):
    config, *_, store = done
    shutil.copytree(store, tmp_path / "store")
    for path in sorted((tmp_path / "store" / stage).rglob("*.safetensors"))[:less]:
        path.unlink()
    found = todo(replace(config, store=str(tmp_path / "store")))
    assert {name: found[name] for name in expected} == expected
    assert {name: found[name] for name in NONE if name not in {*expected, "look"}} == {
        name: 0 for name in NONE if name not in {*expected, "look"}
    }
    assert (found["look"] > 0) == bool({"localise", "train"} & set(expected))


def test_the_disk_it_says_is_the_disk_it_takes(done):
    config, sizes, _, _, store = done
    found = estimate(config, sizes, everything(sizes))
    written = sum(path.stat().st_size for path in store.rglob("*") if path.is_file())
    assert 0.5 * written < found.disk < 2 * written
    stages = [line.stage for line in found.lines]
    assert stages == ["data", "map and localisation", "FD", "PC", "AD", "fusion and evaluation", "pictures"]
    text = found.text().splitlines()
    assert len(text) == 2 + len(stages) + 1
    assert "24 images to make" in text[2]


def test_stages_are_those_of_the_run(done):
    config, sizes, *_ = done
    watch = Stopwatch()
    run(config, watch)
    lines = estimate(config, sizes, everything(sizes)).lines
    assert [*watch.seconds, "pictures"] == [line.stage for line in lines]  # pictures are the report's


def test_more_work_takes_more(done):
    config, sizes, *_ = done

    def of(config, sizes=sizes):
        return estimate(config, sizes, everything(sizes))

    small, large = of(config), of(config, replace(sizes, height=808, width=616))
    assert large.seconds > 2 * small.seconds
    assert large.disk > 2 * small.disk
    assert large.memory > small.memory
    assert of(replace(config, mix=Mix(rows=["FD"]))).seconds < small.seconds
    longer = replace(config, evaluation=replace(config.evaluation, bootstrap=1000, curve_Y=[1, 2, 3]))
    assert of(longer).lines[5].seconds > small.lines[5].seconds
    assert of(replace(config, report=Report(pictures=12))).lines[6].seconds > small.lines[6].seconds
    assert of(replace(config, workers=1)).workers == 1


def test_a_disk_that_is_too_small_is_refused_before_anything_is_made(tmp_path, monkeypatch):
    monkeypatch.setattr(module.shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(10**9, 10**9, 10**4))
    config = config_for(SMALL, tmp_path / "store")
    with pytest.raises(InputError, match=r"this run writes about .* MB, 10\.0 kB are free; free some or choose"):
        run(config, Stopwatch())
    assert not [*Store(config.store).root.rglob("*.png")]


def test_too_little_memory_is_a_warning(done, monkeypatch, caplog):
    config, sizes, *_ = done
    found = estimate(config, sizes, everything(sizes))
    check_room(found, Store(config.store))
    with caplog.at_level(logging.WARNING):
        warn_of_memory(found)
        assert not caplog.text
        monkeypatch.setattr(module.os, "sysconf", lambda name: 10_000)
        warn_of_memory(found)
    assert "this run may need" in caplog.text
    assert "the machine has 100.0 MB" in caplog.text


def test_nclt_is_outlined_from_its_lists(tmp_path):
    write_campus(tmp_path / "raw", SMALL, Store(tmp_path / "campus"))
    settings, store = Nclt(root=str(tmp_path / "raw"), every=0.0), Store(tmp_path / "store")
    before = outline_of(settings, store)
    assert (before.missing, before.images, before.height, before.width) == (24, 24, 202, 154)
    datasets = load_datasets(settings, store, 1)
    assert outline_of(settings, store) == replace(before, missing=0) == outline(datasets)
