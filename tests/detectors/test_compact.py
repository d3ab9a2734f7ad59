"""CC, WC, MW and EF the whole way on a small walk. A first run is the oracle of every other."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import gaussian_filter

from fdslam import estimate as estimates
from fdslam.compact.gradients import Gradients
from fdslam.compact.training import PSEUDO, TREES
from fdslam.config import COMPACT, Compact, Mix
from fdslam.context import Context
from fdslam.data import load_datasets, outline
from fdslam.detectors import compact, early
from fdslam.detectors.registry import DETECTORS
from fdslam.estimate import estimate
from fdslam.hypotheses import hypotheses
from fdslam.mapping import BowMap
from fdslam.obb import Library
from fdslam.pipeline import run
from fdslam.provenance import Stopwatch
from fdslam.store import Store
from fdslam.todo import Todo, everything, remaining
from fdslam.types import grid_shape
from tests.compact.networks import with_backbone
from tests.compact.walks import HEIGHT, PATCH, WIDTH, config_for, walk

BLANK = 2  # this query shows a wall of one grey: it is aligned with nothing
NEW = np.s_[PATCH[0] // 10 : PATCH[2] // 10, PATCH[1] // 10 : PATCH[3] // 10]  # cells


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    root = walk(tmp_path_factory.mktemp("world") / "data")
    Image.fromarray(np.full((HEIGHT, WIDTH, 3), 90, np.uint8)).save(root / "query" / f"{BLANK}.png")
    return root


def sizes_of(config):
    return outline(load_datasets(config.dataset, Store(config.store), 1))


@pytest.fixture(scope="module")
def done(world, tmp_path_factory):
    """A configuration, what was to do before its run, and its outcome."""
    config = config_for(world, tmp_path_factory.mktemp("done") / "store")
    before = everything(config, sizes_of(config))
    return config, before, run(config, Stopwatch())


def context_of(config):
    store = Store(config.store)
    [data] = load_datasets(config.dataset, store, 1)
    bow = BowMap(data.map, config.bow, Library(config.obb), store, 1)
    keys, found = bow.localize(data.query)
    places = hypotheses(config.evaluation, data, found)
    return Context(config, data, store, tuple(found), tuple(keys), places, bow, Gradients(config.compact))


def bytes_of(outcome):
    return {name: [cells.tobytes() for cells in outcome.maps[name]] for name in (*COMPACT, "FD", "FD+CC")}


def stored(config, stage):
    return sorted((Path(config.store) / stage).rglob("*.safetensors"))


def test_every_detector_says_something_of_every_cell(done):
    _, _, outcome = done
    assert {*COMPACT} <= {*DETECTORS}
    for name in (*COMPACT, "FD+CC"):
        for cells in outcome.maps[name]:
            assert cells.shape == grid_shape(HEIGHT, WIDTH)
            assert np.isfinite(cells).all()
    for name in COMPACT:
        assert all(cells.dtype == np.float32 for cells in outcome.maps[name])
    assert {row.method for row in outcome.rows} >= {*COMPACT}


@pytest.mark.parametrize("name", COMPACT)
def test_what_is_new_stands_out(done, name):
    _, _, outcome = done
    for query in (1, 3):
        cells = outcome.maps[name][query]
        elsewhere = np.ones(cells.shape, bool)
        elsewhere[1:10, 2:12] = False
        assert cells[NEW].mean() > np.quantile(cells[elsewhere], 0.9)
        assert cells[NEW].mean() > outcome.maps[name][0][NEW].mean()  # nothing is new there in that one


def test_a_blank_query_is_unlike_nothing(done):
    _, _, outcome = done
    for name in ("CC", "WC", "MW"):
        assert len(np.unique(outcome.maps[name][BLANK])) == 1
    assert np.isfinite(outcome.maps["EF"][BLANK]).all()


def test_workers_change_nothing(done, world, tmp_path):
    config, _, outcome = done
    other = run(replace(config, store=str(tmp_path), workers=2), Stopwatch())
    assert bytes_of(other) == bytes_of(outcome)
    assert other.kept == outcome.kept


def test_a_second_run_computes_nothing_and_a_damaged_store_changes_nothing(done, tmp_path):
    config, _, outcome = done
    shutil.copytree(config.store, tmp_path / "store")
    config = replace(config, store=str(tmp_path / "store"))
    before = {path: path.stat().st_mtime_ns for path in Path(config.store).rglob("*.safetensors")}
    assert bytes_of(run(config, Stopwatch())) == bytes_of(outcome)
    assert {path: path.stat().st_mtime_ns for path in Path(config.store).rglob("*.safetensors")} == before
    for stage in ("dense_signs", "dense_centring", "compact_evidence", TREES.name, PSEUDO.name, "vocabulary"):
        paths = stored(config, stage)
        assert paths, stage
        paths[0].write_bytes(paths[0].read_bytes()[:-5])
    assert bytes_of(run(config, Stopwatch())) == bytes_of(outcome)


def test_the_features_of_a_network_go_the_same_way(done, tmp_path):
    config, _, outcome = done
    weights = with_backbone(tmp_path / "net.onnx", height=128, width=160)
    found = []
    for workers, threads in ((1, 1), (2, 2)):
        store = tmp_path / f"store{workers}"
        shutil.copytree(config.store, store)
        compact_switches = Compact(weights=str(weights), threads=threads)
        changed = replace(config, store=str(store), workers=workers, compact=compact_switches, mix=Mix(rows=["CC"]))
        found.append(run(changed, Stopwatch()).maps["CC"])
    for one, two, other in zip(*found, outcome.maps["CC"], strict=True):
        assert one.tobytes() == two.tobytes()
        assert np.isfinite(one).all()
        assert one.shape == other.shape
    assert not np.array_equal(found[0][0], outcome.maps["CC"][0])


def test_cc_is_the_weighted_sum_of_both_strides(done):
    config, _, outcome = done
    context = context_of(config)
    seen = compact.all_evidence(context, compact.compact_map(context))
    for query, one in enumerate(seen):
        expected = config.compact.fine * one["fine"] + (1 - config.compact.fine) * one["coarse"]
        if config.compact.sigma:
            expected = gaussian_filter(expected, config.compact.sigma)
        assert np.allclose(outcome.maps["CC"][query], expected, atol=1e-6)
        assert np.array_equal(outcome.maps["WC"][query], one["words"])
        assert np.array_equal(outcome.maps["MW"][query], one["missing"])
    sharp = replace(context, config=replace(config, compact=replace(config.compact, sigma=0.0, fine=1.0)))
    for one, loc in zip(seen, compact.detect(sharp).loc, strict=True):
        assert np.array_equal(loc, one["fine"])


def test_what_is_kept(done):
    config, _, outcome = done
    context = context_of(config)
    kept = compact.compact_map(context).kept()
    assert outcome.kept["CC"] == outcome.kept["WC"] == outcome.kept["MW"] == kept
    trees = early.trees_of(context)
    learned = sum(array.nbytes for array in trees.arrays().values())
    assert outcome.kept["EF"] == pytest.approx(kept + learned / 12)


def test_a_map_image_without_keypoints_is_no_error(world, tmp_path):
    root = tmp_path / "data"
    shutil.copytree(world, root)
    (root / "annotations.json").unlink()
    Image.fromarray(np.full((HEIGHT, WIDTH, 3), 90, np.uint8)).save(root / "map" / "05.png")
    outcome = run(config_for(root, tmp_path / "store"), Stopwatch())
    for name in COMPACT:
        assert all(np.isfinite(cells).all() for cells in outcome.maps[name])


NOTHING = vars(Todo())


def todo(config):
    store = Store(config.store)
    datasets = load_datasets(config.dataset, store, 1)
    return vars(remaining(config, datasets, Library(config.obb), None, store, Gradients(config.compact)))


def test_what_is_to_do_is_what_a_run_then_makes(done):
    config, before, _ = done
    assert before.looks == len(stored(config, "dense_signs")) == 16
    assert before.evidence == len(stored(config, "compact_evidence")) == 4
    assert before.pretend == len(stored(config, PSEUDO.name)) == 12
    assert todo(config) == NOTHING


@pytest.mark.parametrize(
    ("stages", "expected"),
    [
        (["dense_signs"], {"looks": 2}),
        (["compact_evidence"], {"evidence": 2}),
        ([PSEUDO.name], {}),  # the trees are there
        ([TREES.name], {}),  # fitted in no time
        ([PSEUDO.name, TREES.name], {"pretend": 2}),
        (["localization"], {"localise": 2, "fd": 4, "evidence": 4}),  # what they are compared with is not known
    ],
)
def test_what_is_lost_is_to_do_again(done, tmp_path, stages, expected):
    config, *_ = done
    shutil.copytree(config.store, tmp_path / "store")
    config = replace(config, store=str(tmp_path / "store"))
    for stage in stages:
        for path in stored(config, stage)[:2]:
            path.unlink()
    assert todo(config) == NOTHING | expected


def test_rows_without_them_have_nothing_of_it_to_do(done, tmp_path):
    config, *_ = done
    plain = replace(config, store=str(tmp_path), mix=Mix(rows=["FD"]))
    found = everything(plain, sizes_of(plain))
    assert (found.looks, found.evidence, found.pretend) == (0, 0, 0)
    raw = replace(plain, mix=Mix(rows=["CC"]))
    found = everything(raw, sizes_of(raw))
    assert (found.looks, found.evidence, found.pretend) == (16, 4, 0)


def test_an_estimate_has_a_line_for_each_and_more_work_takes_more(done, monkeypatch):
    monkeypatch.setattr(estimates, "_task", lambda: estimates.REFERENCE)
    config, before, _ = done
    sizes = sizes_of(config)
    whole = {line.stage: line for line in estimate(config, sizes, before).lines}
    assert [name for name in whole if name in COMPACT] == list(COMPACT)
    nothing = {line.stage: line for line in estimate(config, sizes, Todo()).lines}
    for name in ("CC", "EF"):
        assert whole[name].seconds > nothing[name].seconds
        assert whole[name].disk > nothing[name].disk == 0
    alone = replace(config, mix=Mix(rows=["EF"]))
    lines = {line.stage: line for line in estimate(alone, sizes, before).lines}
    assert lines["EF"].seconds > whole["EF"].seconds  # what CC had found for it is its own work then
    written = sum(
        path.stat().st_size for stage in ("dense_signs", "compact_evidence") for path in stored(config, stage)
    )
    assert 0.3 * written < whole["CC"].disk < 8 * written  # small images take fewer bytes than they may
