"""The compiled loops against numpy, and against counting one pair at a time."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fdslam.metrics import kernels


@pytest.mark.parametrize("dtype", [np.int32, np.int64])
@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 40), st.sampled_from([1, 2, 5, 20, 300]), st.sampled_from([1, 4, 4096]))
def test_pairs_that_are_not_won_are_counted(dtype, seed, n, levels, buckets):
    rng = np.random.default_rng(seed)
    ranks = (rng.integers(0, levels + 1, 300) * (300 // levels)).astype(dtype)  # 0 to N, both in use
    starts, offsets = rng.integers(0, 200, 7), np.sort(rng.choice(100, n, replace=False))
    own = np.sort(ranks[offsets + rng.integers(0, 200)])
    counted = [sum(2 * (v > o) + (v == o) for v in ranks[start + offsets] for o in own) for start in starts]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernels, "BUCKETS", buckets)
        assert kernels.not_above(own, ranks, starts, offsets).tolist() == counted
        patch.setattr(kernels, "NATIVE", False)
        assert kernels.not_above(own, ranks, starts, offsets).tolist() == counted
