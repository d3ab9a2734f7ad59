"""Scene: order by name, what is derived, and its complaints."""

import numpy as np
import pytest

from fdslam.errors import InputError
from fdslam.metrics import Scene
from tests.metrics.scenes import make

SIZES = [(30, 30), (10, 25)]


def test_cells_run_over_queries_by_name():
    scene = make("ba", SIZES, [[[20, 20, 30, 30], [0, 0, 10, 10]], []])
    assert scene.by_name == (1, 0)
    assert scene.shapes == ((1, 3), (3, 3))
    assert scene.starts.tolist() == [0, 3, 12]
    assert scene.query_of.tolist() == [0] * 3 + [1] * 9
    assert scene.unchanged.tolist() == [0]
    assert scene.objects.query.tolist() == [1, 1]
    assert [c.tolist() for c in scene.objects.cells] == [[3], [11]]
    assert scene.objects.listed.tolist() == [1, 0]
    assert np.flatnonzero(scene.positive).tolist() == [3, 11]
    loc = [np.arange(9).reshape(3, 3), np.array([[20, 21, 22]])]
    assert scene.flatten("map", loc).tolist() == [20, 21, 22, *range(9)]


def test_no_queries_and_no_boxes():
    empty = Scene((), (), (), ())
    assert empty.flatten("map", []).shape == empty.positive.shape == empty.objects.area.shape == (0,)
    assert not make("ab", SIZES, [[], []]).positive.any()


@pytest.mark.parametrize(
    ("loc", "message"),
    [
        ([np.zeros((3, 3))], "FD: 1 maps for 2 queries"),
        ([np.zeros((3, 3)), np.zeros((3, 1))], "FD: the map of a is"),
        ([np.full((3, 3), np.nan), np.zeros((1, 3))], "FD: the map of b holds NaN"),
    ],
)
def test_bad_maps(loc, message):
    with pytest.raises(InputError, match=message) as error:
        make("ba", SIZES, [[], []]).flatten("FD", loc)
    assert "\n" not in str(error.value)


def test_names_must_be_unique_and_fields_of_one_length():
    with pytest.raises(InputError, match="two queries are named 'a'"):
        make("aa", SIZES, [[], []])
    with pytest.raises(InputError, match="one entry per query"):
        Scene(("a",), (10,), (10,), ())
