import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdslam.bow.islands import islands
from tests.reference import refinement

ROW = st.lists(st.sampled_from([0, 0, 1, 2, 3, 4, 7, 10, 1 << 51]), min_size=1, max_size=24)


@given(ROW, st.sampled_from(["ibow", "dloop"]))
def test_levels_order_as_the_oracle_does(row, rule):
    levels = islands(np.array([row]), rule)[0]
    keys = refinement.island_order(row, rule)
    for a in range(len(row)):
        assert (levels[a] == 0) == (keys[a] is None)
        for b in range(len(row)):
            if keys[a] is not None and keys[b] is not None:
                assert (levels[a] > levels[b]) == (keys[a] < keys[b])


def test_neighbours_vouch_for_each_other():
    row = np.array([[9, 0, 0, 0, 0, 0, 0, 0, 7, 8, 7, 0]])
    assert islands(row, "dloop")[0].argmax() == 9  # 22 together beat 9 alone
    # [0, 3] is trimmed by the map's end: 9/4 loses to 22/6 of [6, 11].
    assert islands(row, "ibow")[0].argmax() == 9
    assert islands(row, "none")[0].argmax() == 0


@pytest.mark.parametrize("rule", ["ibow", "dloop"])
def test_a_list_that_tells_nothing_is_left_alone(rule):
    assert islands(np.zeros((2, 4), np.int64), rule).tolist() == [[0] * 4] * 2
    assert islands(np.full((1, 3), 5), rule).tolist() == [[5] * 3]
    assert islands(np.zeros((0, 4), np.int64), rule).shape == (0, 4)
