"""The training of the shipped early fusion on tiny campuses; the detector EF is the oracle of what it looks at."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.train import early_fusion
from experiments.train.early_fusion import KINDS, cell_labels, looked_at, of_queries, opened, trained
from fdslam.compact import shipped
from fdslam.compact.features import NAMES
from fdslam.compact.shipped import shipped_trees
from fdslam.compact.training import NEITHER
from fdslam.detectors import early
from fdslam.errors import InputError

WORLD = (7, "SU", "AU")
SMALL = ["dataset.images=48", "dataset.width=120", "dataset.height=160", "obb=j_b", "workers=1"]
LEARNER = ["early.trees=4", "early.leaves=6", "early.images=6", "evaluation.bootstrap=10"]


@pytest.fixture(scope="module")
def overrides(tmp_path_factory):
    return [*SMALL, *LEARNER, f"store={tmp_path_factory.mktemp('store')}"]


@pytest.fixture(scope="module")
def world(overrides):
    return early_fusion.cells(WORLD, "gradients", overrides)


def test_what_is_trained_on_is_nowhere_else():
    chosen = [[seed for seed, *_ in worlds] for worlds in (early_fusion.TRAINING, early_fusion.VALIDATION)]
    tested = [seed for seed, *_ in early_fusion.TEST]
    every = [*chosen[0], *chosen[1], *tested]
    assert len(set(every)) == len(every)
    others = [*range(1000, 1012), *range(1100, 1106), *range(2000, 2004), *range(3000, 3004), 5000]
    assert not {*chosen[0], *chosen[1]} & {0, 4, *others}


def test_a_cell_is_changed_by_half_unchanged_by_nothing_and_neither_between():
    found = cell_labels(np.array([[10, 0, 30, 10]], np.float32), 30, 40).reshape(3, 4)
    assert found.tolist() == [[0, 1, 1, 0], [0] * 4, [0] * 4]
    found = cell_labels(np.array([[5, 0, 34, 10.5]], np.float32), 30, 40).reshape(3, 4)
    assert found.tolist() == [[1, 1, 1, NEITHER], [NEITHER] * 4, [0] * 4]
    assert cell_labels(np.empty((0, 4), np.float32), 30, 40).tolist() == [0] * 12


def test_every_kind_of_data_has_both_labels_and_no_other(world):
    for rows, label in world.rows.values():
        assert rows.shape == (len(label), len(NAMES))
        assert set(label.tolist()) == {0, 1}
    assert set(world.rows) == {kind for kinds in KINDS.values() for kind in kinds}
    cells = sum(map(len, world.queries))
    assert 0.5 * cells < len(world.rows["queries"][1]) <= cells


def test_the_detector_with_the_written_file_says_the_same(world, overrides, tmp_path, monkeypatch):
    learner = trained([world], KINDS["both"], 0)
    monkeypatch.setattr(shipped, "shipped", lambda name: tmp_path / name)
    early_fusion.write(tmp_path / shipped.file_name("gradients"), learner)
    where = ["dataset.seed=7", "dataset.query=SU", "dataset.map=AU"]
    context = opened(early_fusion.configured(["mode=best", "compact.source=gradients", *where, *overrides]))
    context = replace(context, config=replace(context.config, early=replace(context.config.early, model="shipped")))
    assert shipped_trees(context.config).arrays().keys() == learner.arrays().keys()
    for mine, theirs in zip(looked_at(world, learner), early.detect(context).loc, strict=True):
        np.testing.assert_array_equal(mine, theirs)
    for mine, theirs in zip(of_queries(context), world.queries, strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_the_script_writes_one_file_twice_and_prints_all_tables(overrides, tmp_path, capsys, monkeypatch):
    for name in ("TRAINING", "VALIDATION", "TEST"):
        monkeypatch.setattr(early_fusion, name, (WORLD,))
    files = [tmp_path / "one", tmp_path / "two"]
    for file in files:
        early_fusion.main(["--source", "gradients", "--out", str(file), *overrides])
    assert files[0].read_bytes() == files[1].read_bytes()
    printed = capsys.readouterr().out
    for row in ("CC", *(f"{row} shipped, {kind}" for row in ("EF", "CC+EF") for kind in KINDS)):
        assert printed.count(f"| {row} |") == 2 * 2, row
    assert printed.count("| EF of this map |") == 2  # of the test's world alone
    other = tmp_path / "map"
    early_fusion.main(["--source", "gradients", "--out", str(other), "--data", "map", *overrides])
    assert other.read_bytes() != files[0].read_bytes()


def test_another_data_set_is_refused(overrides, tmp_path):
    with pytest.raises(InputError, match=r"dataset\.seed"):
        early_fusion.cells(WORLD, "gradients", ["dataset=nclt", f"dataset.root={tmp_path}"])
