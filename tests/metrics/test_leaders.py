"""Oracle: counting object by object."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fdslam.metrics import Leader, leaders
from fdslam.metrics.leaders import grade


def test_grade_is_the_first_percentage_that_finds():
    found = np.array([[1, 0, 0, 0], [1, 1, 0, 0], [1, 0, 0, 1]], dtype=bool)
    assert grade(found).tolist() == [0, 1, 3, 2]


def test_leaders_by_hand():
    grades = {"FD": np.array([0, 1, 4, 2]), "PC": np.array([1, 1, 4, 4]), "AD": np.array([2, 3, 4, 4])}
    expected = {"FD": Leader(50.0, 25.0), "PC": Leader(0.0, 25.0), "AD": Leader(0.0, 0.0)}
    assert leaders(grades, otherwise=4) == expected


@given(st.integers(1, 4), st.integers(1, 12), st.integers(0, 2**32))
def test_leaders_match_counting(methods, objects, seed):
    table = np.random.default_rng(seed).integers(0, 5, (methods, objects))
    result = leaders({str(m): table[m] for m in range(methods)}, otherwise=4)
    for m in range(methods):
        solo = co = 0
        for o in range(objects):
            others = [table[n, o] for n in range(methods) if n != m]
            best = table[m, o] < 4 and all(table[m, o] <= other for other in others)
            tied = table[m, o] in others
            solo, co = solo + (best and not tied), co + (best and tied)
        assert result[str(m)] == Leader(100.0 * solo / objects, 100.0 * co / objects) or np.allclose(
            [result[str(m)].solo, result[str(m)].co], [100 * solo / objects, 100 * co / objects], rtol=1e-12
        )


def test_nobody_leads_without_objects():
    assert leaders({}, 4) is None
    assert leaders({"FD": np.zeros(0, int)}, 4) is None
