"""Against a loop over all pairs."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fdslam.data.relevance import places_by_pose

POSES = st.lists(st.tuples(st.integers(-8, 8), st.integers(-8, 8), st.floats(-20, 20)), min_size=1, max_size=9)


@given(POSES, POSES, st.sampled_from([0.0, 1.0, 5.0]), st.sampled_from([10.0, 45.0, 180.0]))
def test_places_are_near_look_the_same_way_and_come_nearest_first(queries, maps, radius, angle):
    found = places_by_pose(np.array(queries, float), np.array(maps, float), radius, angle)
    for (x, y, heading), places in zip(queries, found, strict=True):
        near = []
        for m, (u, v, other) in enumerate(maps):
            turn = math.degrees(abs(math.atan2(math.sin(heading - other), math.cos(heading - other))))
            if math.dist((x, y), (u, v)) <= radius and turn <= angle + 1e-9:
                near.append((math.dist((x, y), (u, v)), m))
        assert places.tolist() == [m for _, m in sorted(near)]
        assert places.dtype == np.int64
