"""The compiled loops against numpy, and against counting one pair at a time."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fdslam.metrics import kernels


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 40), st.sampled_from([1, 2, 5, 10**6]))
def test_pairs_that_are_not_won_are_counted(dtype, seed, n, levels):
    rng = np.random.default_rng(seed)
    values = rng.integers(-levels, levels, 300).astype(dtype)
    own, starts = np.sort(rng.integers(-levels, levels, n).astype(dtype)), rng.integers(0, 200, 7)
    offsets = np.sort(rng.choice(100, n, replace=False))
    counted = [sum(2 * (v > o) + (v == o) for v in values[start + offsets] for o in own) for start in starts]
    assert kernels.not_above(own, values, starts, offsets).tolist() == counted
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernels, "NATIVE", False)
        assert kernels.not_above(own, values, starts, offsets).tolist() == counted
