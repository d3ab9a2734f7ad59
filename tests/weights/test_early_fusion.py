"""The shipped learners of early fusion: they fit the features of this version, and more change is more suspicious."""

from pathlib import Path

import numpy as np
import pytest
from hatchling.builders.wheel import WheelBuilder

import fdslam
from fdslam.compact.features import NAMES
from fdslam.compact.shipped import file_name, shipped_trees
from fdslam.compact.trees import LEAF
from fdslam.config import Compact, Config

SOURCES = ("network", "gradients")
WEIGHTS = Path(fdslam.__file__).parent / "weights"


@pytest.fixture(params=SOURCES)
def source(request):
    return request.param


@pytest.fixture
def trees(source):
    return shipped_trees(Config(compact=Compact(source=source)))  # InputError if made for other features


def test_it_looks_at_features_that_there_are(trees):
    inner = trees.feature[trees.feature != LEAF]
    assert inner.min() >= 0
    assert inner.max() < len(NAMES)
    assert len(trees.roots) > 50


def test_it_says_something_finite_of_any_cell(trees):
    rows = np.random.default_rng(0).normal(0, 1, (500, len(NAMES)))
    told = trees.log_odds(rows)
    assert np.isfinite(told).all()
    assert np.ptp(told) > 1


def test_a_cell_that_differs_more_is_more_suspicious(trees):
    rows = np.zeros((2, len(NAMES)))
    for k, name in enumerate(NAMES):
        what, _, form = name.rpartition(" ")
        if what.startswith(("fine", "coarse", "words", "FD")):
            rows[:, k] = (-1.0, 4.0) if form == "normalised" else (0.1, 0.45)
    calm, changed = trees.log_odds(rows)
    assert changed > calm + 2


def test_the_file_is_small_and_its_card_says_how_it_was_made(source):
    path = WEIGHTS / file_name(source)
    assert path.stat().st_size < 300_000
    card = (WEIGHTS / "early_fusion.md").read_text()
    for word in ("python -m experiments.train.early_fusion", path.name, "knows only the embedded world", "lcAUC"):
        assert word in card, word


def test_the_wheel_has_it(source):
    root = Path(__file__).parents[2]
    inside = {file.distribution_path for file in WheelBuilder(str(root)).recurse_included_files()}
    assert {f"fdslam/weights/{file_name(source)}", "fdslam/weights/early_fusion.md"} <= inside
