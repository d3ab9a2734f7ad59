"""Oracle: scikit-learn's decision function, and its trees walked node by node."""

from itertools import pairwise

import numpy as np
import pytest
from sklearn.ensemble import HistGradientBoostingClassifier

from fdslam.compact import trees as module
from fdslam.compact.features import NAMES
from fdslam.compact.training import fit
from fdslam.compact.trees import LEAF, Trees
from fdslam.config import Training
from fdslam.store import Stage, Store
from tests.reference.compact import log_odds


def trained(seed, rows=600, features=9, trees=12, leaves=8):
    """A classifier, and rows it has not seen; many values occur several times, as constant cells do."""
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((2 * rows, features)).astype(np.float32)
    x[:, 0] = np.round(x[:, 0])
    x[:, 1] = 3.0
    y = (x[:, 0] * x[:, 2] + x[:, 3] + rng.normal(0, 0.5, len(x)) > 0).astype(int)
    model = HistGradientBoostingClassifier(
        max_iter=trees, max_leaf_nodes=leaves, learning_rate=0.2, early_stopping=False, random_state=0
    )
    return model.fit(x[:rows], y[:rows]), x[rows:].astype(np.float64)


CASES = [(0, {}), (1, {"leaves": 2}), (2, {"trees": 1}), (3, {"features": 60, "leaves": 31}), (4, {"rows": 30})]


@pytest.mark.parametrize("native", [True, False])
@pytest.mark.parametrize(("seed", "sizes"), CASES)
def test_scores_are_those_of_scikit_learn(monkeypatch, native, seed, sizes):
    monkeypatch.setattr(module, "NATIVE", native and module.NATIVE)
    model, rows = trained(seed, **sizes)
    ours = Trees.of(model).log_odds(rows)
    assert ours.dtype == np.float64
    assert np.array_equal(ours, model.decision_function(rows))
    assert [*ours[:20]] == [log_odds(model, row) for row in rows[:20]]
    assert sizes == {"rows": 30} or len(np.unique(ours)) > 1


@pytest.mark.parametrize("native", [True, False])
def test_a_value_at_exactly_the_threshold_goes_left(monkeypatch, native):
    monkeypatch.setattr(module, "NATIVE", native and module.NATIVE)
    model, rows = trained(5)
    ours = Trees.of(model)
    inner = np.flatnonzero(ours.feature >= 0)
    exact = np.repeat(rows[:1], 3 * len(inner), axis=0)
    for i, node in enumerate(inner):
        threshold = ours.threshold[node]
        exact[3 * i : 3 * i + 3, ours.feature[node]] = threshold, np.nextafter(threshold, 1e9), -1e30
    scores = ours.log_odds(exact)
    assert np.array_equal(scores, model.decision_function(exact))
    root = int(np.flatnonzero(inner == ours.roots[0])[0])
    stump = Trees(*(np.array(a) for a in ([0], [0, -1, -1], [2.5, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1.0, 5.0])), 0.25)
    assert stump.log_odds(np.array([[2.5], [np.nextafter(2.5, 3)], [-1], [9]])).tolist() == [1.25, 5.25, 1.25, 5.25]
    assert scores[3 * root] != scores[3 * root + 1]


def test_both_paths_agree_on_many_rows(monkeypatch):
    if not module.NATIVE:
        pytest.skip("there is no numba here")
    model, rows = trained(6, rows=5000)
    native = Trees.of(model).log_odds(rows)
    monkeypatch.setattr(module, "NATIVE", False)
    assert np.array_equal(Trees.of(model).log_odds(rows), native)
    strided = np.repeat(rows, 2, axis=1)[:, ::2]
    assert np.array_equal(Trees.of(model).log_odds(strided), native)


def test_storage_keeps_every_bit(tmp_path):
    model, rows = trained(7)
    ours, store, stage = Trees.of(model), Store(tmp_path), Stage("trees", ())
    key = stage.key({}, [])
    store.put(stage, key, ours.arrays())
    again = Trees.from_arrays(store.get(stage, key))
    assert np.array_equal(again.log_odds(rows), model.decision_function(rows))
    assert again.baseline == ours.baseline
    for name, array in ours.arrays().items():
        assert array.dtype == again.arrays()[name].dtype
        assert np.array_equal(array, again.arrays()[name])


def test_no_rows():
    assert Trees.of(trained(0)[0]).log_odds(np.zeros((0, 9))).shape == (0,)


def test_a_leaf_is_learned_from_as_many_cells_as_is_asked():
    """The oracle is where each row ends up, tree by tree: a leaf that few rows reach says what only they are like."""
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(3000, len(NAMES))).astype(np.float32)
    label = (rng.random(3000) < 0.05).astype(np.uint8)
    largest = {}
    for leaf, l2 in ((60, 0.0), (5, 0.0), (5, 50.0)):
        trees = fit(rows, label, Training(trees=10, leaf=leaf, l2=l2), 0)
        for begin, end in pairwise([*trees.roots, len(trees.feature)]):
            reached = np.full(len(rows), begin)
            while (inner := np.flatnonzero(trees.feature[reached] != LEAF)).size:
                at = reached[inner]
                left = rows[inner, trees.feature[at]] <= trees.threshold[at]
                reached[inner] = np.where(left, trees.left[at], trees.right[at])
            held = np.bincount(reached - begin, minlength=end - begin)[trees.feature[begin:end] == LEAF]
            assert held.min() >= leaf
        largest[leaf, l2] = np.abs(trees.value[trees.feature == LEAF]).max()
    assert max(largest[60, 0.0], largest[5, 50.0]) < largest[5, 0.0] / 2
