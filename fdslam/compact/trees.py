"""Gradient-boosted trees as plain arrays: what scikit-learn has trained, evaluated and stored without it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier

from fdslam.native import NATIVE, njit
from fdslam.store import Arrays
from fdslam.types import Cells

LEAF = -1


@dataclass(frozen=True)
class Trees:
    """An ensemble of binary trees; the nodes of all lie one after the other, each tree from its root on."""

    roots: NDArray[np.int32]  # [trees] node of each root
    feature: NDArray[np.int16]  # [nodes] that decides; LEAF in leaves
    threshold: NDArray[np.float64]  # [nodes] left where the feature is at most this
    left: NDArray[np.int32]  # [nodes]
    right: NDArray[np.int32]  # [nodes]
    value: NDArray[np.float64]  # [nodes] what a leaf adds
    baseline: float  # log odds before all trees

    def log_odds(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the log odds of rows of features, float64 [n, features], finite: float64 [n]."""
        if NATIVE:
            out = np.full(len(rows), self.baseline)
            nodes = self.feature, self.threshold, self.left, self.right, self.value
            _evaluate(np.ascontiguousarray(rows), self.roots, *nodes, out)
            return out
        total = np.full(len(rows), self.baseline)
        for root in self.roots:
            node = np.full(len(rows), root)
            while (inner := np.flatnonzero(self.feature[node] != LEAF)).size:
                at = node[inner]
                goes_left = rows[inner, self.feature[at]] <= self.threshold[at]
                node[inner] = np.where(goes_left, self.left[at], self.right[at])
            total += self.value[node]
        return total

    def loc(self, rows: NDArray[np.float32], shape: tuple[int, int]) -> Cells:
        """Return the log odds of an image's cells, float32 of that shape, from their features row by row."""
        return self.log_odds(rows.astype(np.float64)).reshape(shape).astype(np.float32)

    def arrays(self) -> Arrays:
        """Return everything for storage; ``from_arrays`` takes it back."""
        return {
            "roots": self.roots,
            "feature": self.feature,
            "threshold": self.threshold,
            "left": self.left,
            "right": self.right,
            "value": self.value,
            "baseline": np.array(self.baseline, np.float64),
        }

    @classmethod
    def from_arrays(cls, arrays: Arrays) -> Trees:
        """Return trees from what ``arrays`` gave."""
        names = ("feature", "threshold", "left", "right", "value")
        feature, threshold, left, right, value = (arrays[name] for name in names)
        return cls(arrays["roots"], feature, threshold, left, right, value, float(arrays["baseline"]))

    @classmethod
    def of(cls, model: HistGradientBoostingClassifier) -> Trees:
        """Return the trees of a trained binary classifier without categories; their sum is its decision function."""
        nodes = [one[0].nodes for one in model._predictors]  # its only way to the trees
        sizes = np.array([len(one) for one in nodes])
        roots = (np.cumsum(sizes) - sizes).astype(np.int32)
        joined, shift = np.concatenate(nodes), np.repeat(roots, sizes)
        leaf = joined["is_leaf"].astype(bool)
        return cls(
            roots,
            np.where(leaf, LEAF, joined["feature_idx"]).astype(np.int16),
            joined["num_threshold"].astype(np.float64),
            np.where(leaf, 0, joined["left"] + shift).astype(np.int32),
            np.where(leaf, 0, joined["right"] + shift).astype(np.int32),
            joined["value"].astype(np.float64),
            float(np.ravel(model._baseline_prediction)[0]),
        )


@njit
def _evaluate(rows, roots, feature, threshold, left, right, value, out):
    """Add to ``out`` [n] the leaves that each row reaches, tree after tree."""
    for i in range(len(rows)):
        row = rows[i]
        total = out[i]
        for root in roots:
            node = root
            while feature[node] >= 0:
                node = left[node] if row[feature[node]] <= threshold[node] else right[node]
            total += value[node]
        out[i] = total
