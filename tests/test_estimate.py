"""What a run says it will take. The oracle is what a run then leaves in its store."""

import logging
import shutil
from dataclasses import replace

import pytest

from experiments.table1.campus_as_nclt import write_campus
from fdslam import estimate as module
from fdslam.config import Campus, Evaluation, Fd, Mix, Nclt, Report
from fdslam.data import ledger, load_datasets, outline, outline_of
from fdslam.errors import InputError
from fdslam.estimate import check_room, estimate, warn_of_memory
from fdslam.obb import Library
from fdslam.pipeline import run
from fdslam.provenance import Stopwatch
from fdslam.store import Store
from fdslam.todo import Todo, everything, remaining
from tests.test_pipeline import config_for

SMALL = Campus(images=24, width=154, height=202, objects=24, distractors=24, all_pairs=True)
NOTHING = vars(Todo())


def stored(store, stage):
    return len(list((store / stage).rglob("*.safetensors")))


def todo(config):
    store = Store(config.store)
    return vars(remaining(config, load_datasets(config.dataset, store, 1), Library(config.obb), None, store))


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A configuration, what was to do before its run, and its store after it."""
    store = tmp_path_factory.mktemp("estimate") / "store"
    config = config_for(SMALL, store, mix=Mix(rows=["FD", "PC", "AD"]), evaluation=Evaluation(bootstrap=20))
    sizes = outline_of(config.dataset, Store(store))
    before = vars(everything(config, sizes))
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
    assert todo(config) == NOTHING


@pytest.mark.parametrize(
    ("stage", "less", "expected"),
    [
        ("features", 5, {"features": 5}),
        ("map", 4, {}),  # words of the images are stored: nothing is learned again
        ("fd", 3, {"fd": 3}),
        ("pc", 3, {"pc": 3}),
        ("pc_features", 3, {}),  # nothing has to be compared again
        ("ad", 3, {"ad": 3}),
        ("autoencoder", 99, {"train": 24, "ad": None}),
        ("places", 1, {"train": 6, "ad": None}),
        ("localization", 1, {"localise": 1, "fd": None, "pc": None, "ad": None}),
    ],
)
def test_what_is_lost_is_to_do_again(done, tmp_path, stage, less, expected):
    """None: some, as what they were compared with is not known any more."""
    config, *_, store = done
    shutil.copytree(store, tmp_path / "store")
    for path in sorted((tmp_path / "store" / stage).rglob("*.safetensors"))[:less]:
        path.unlink()
    found = todo(replace(config, store=str(tmp_path / "store")))
    assert {name for name, count in found.items() if count} == expected.keys()
    assert all(found[name] == count for name, count in expected.items() if count is not None)


def test_another_detector_or_y_on_a_finished_store_is_to_do(done):
    config, _, _, outcome, _ = done
    queries = len(outcome.dataset.query)
    other = replace(config, evaluation=replace(config.evaluation, Y=3, curve_Y=[1]))
    assert todo(other) == NOTHING | {"fd": 2 * queries, "pc": 2 * queries}
    assert todo(replace(config, pc=replace(config.pc, sigma=2.0)))["sift"] > 12
    assert todo(replace(config, fd=Fd(support=1.0))) == NOTHING | {"fd": queries, "support": queries}


def test_lost_results_with_lost_sifts_are_counted_with_them(done, tmp_path):
    config, *_, store = done
    shutil.copytree(store, tmp_path / "store")
    for stage in ("pc", "pc_features"):
        shutil.rmtree(tmp_path / "store" / stage)
    found = todo(replace(config, store=str(tmp_path / "store")))
    assert found["sift"] == stored(store, "pc_features")
    assert found["pc"] == stored(store, "pc")


def test_the_disk_it_says_is_the_disk_it_takes(done):
    config, sizes, _, _, store = done
    found = estimate(config, sizes, everything(config, sizes))
    written = sum(path.stat().st_size for path in store.rglob("*") if path.is_file())
    assert 0.5 * written < found.disk < 2 * written
    stages = [line.stage for line in found.lines]
    assert stages == ["data", "map and localisation", "FD", "PC", "AD", "fusion and evaluation", "pictures"]
    text = found.text(stored=False).splitlines()
    assert len(text) == 2 + len(stages) + 1
    assert "24 images to make" in text[2]


def test_stages_are_those_of_the_run(done):
    config, sizes, *_ = done
    watch = Stopwatch()
    run(config, watch)
    lines = estimate(config, sizes, everything(config, sizes)).lines
    assert [*watch.seconds, "pictures"] == [line.stage for line in lines]  # pictures are the report's


def test_more_work_takes_more(done, monkeypatch):
    monkeypatch.setattr(module, "_task", lambda: module.REFERENCE)
    config, sizes, *_ = done

    def of(config, sizes=sizes):
        return estimate(config, sizes, everything(config, sizes))

    small, large = of(config), of(config, replace(sizes, height=808, width=616))
    assert large.seconds > 1.5 * small.seconds
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
    found = estimate(config, sizes, everything(config, sizes))
    check_room(found.disk, Store(config.store))
    with caplog.at_level(logging.WARNING):
        warn_of_memory(found)
        assert not caplog.text
        monkeypatch.setattr(module.os, "sysconf", lambda name: 10_000)
        warn_of_memory(found)
    assert "this run may need" in caplog.text
    assert "the machine has 100.0 MB" in caplog.text


def test_nclt_is_outlined_from_its_lists(tmp_path, monkeypatch):
    monkeypatch.setattr(ledger, "SETTLED", 0)  # files that were made this second are remembered too
    write_campus(tmp_path / "raw", SMALL, Store(tmp_path / "campus"))
    settings, store = Nclt(root=str(tmp_path / "raw"), every=0.0), Store(tmp_path / "store")
    before = outline_of(settings, store)
    assert (before.missing, before.images, before.height, before.width) == (24, 24, 202, 154)
    datasets = load_datasets(settings, store, 1)
    assert outline_of(settings, store) == replace(before, missing=0) == outline(datasets)
    image = next((tmp_path / "raw").rglob("*.tiff"))
    image.write_bytes(image.read_bytes() + b" ")  # another file now
    assert outline_of(settings, store).missing == 1


def test_a_world_without_queries_is_refused_in_the_loader_s_words(tmp_path):
    config = config_for(Campus(images=40, width=154, height=202, objects=1, distractors=0), tmp_path / "store")
    with pytest.raises(InputError, match=r"no image of AU is a query against SU; raise dataset\.images=40"):
        run(config, Stopwatch())
