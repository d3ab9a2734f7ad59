"""Stores over stores; a dict is the oracle of what is found where."""

import numpy as np
import pytest

from fdslam.errors import InputError
from fdslam.layers import Copying, Layered, Sealed
from fdslam.store import Stage, Store

STAGE = Stage("stage", ())
KEYS = [STAGE.key({}, [name]) for name in "abc"]


def one(value):
    return {"value": np.array([value])}


def value(store, key):
    arrays = store.get(STAGE, key)
    return None if arrays is None else int(arrays["value"][0])


@pytest.fixture(params=["memory", "disk"])
def layered(request, tmp_path):
    below = Store(tmp_path / "below")
    below.put(STAGE, KEYS[0], one(1))
    above = Store(tmp_path / "above") if request.param == "disk" else None
    return below, above, Layered(below, above)


def test_what_is_put_lies_above_and_what_is_below_stays(layered):
    below, above, store = layered
    assert store.lacks(STAGE, KEYS) == 2
    store.put(STAGE, KEYS[1], one(2))
    store.put(STAGE, KEYS[0], one(7))
    assert [value(store, key) for key in KEYS] == [7, 2, None]
    assert [store.has(STAGE, key) for key in KEYS] == [True, True, False]
    assert store.lacks(STAGE, KEYS) == 1
    assert [value(below, key) for key in KEYS] == [1, None, None]
    if above is not None:
        assert [value(above, key) for key in KEYS] == [7, 2, None]
        assert store.path(STAGE, KEYS[1]).is_file()
    assert store.path(STAGE, KEYS[0]) == below.path(STAGE, KEYS[0])
    store.discard(STAGE, KEYS[0])
    assert value(store, KEYS[0]) == 1


def test_arrays_are_the_callers_own(layered):
    _, _, store = layered
    mine = one(3)
    store.put(STAGE, KEYS[2], mine)
    mine["value"][0] = 4
    store.get(STAGE, KEYS[2])["value"][0] = 5
    assert value(store, KEYS[2]) == 3


def test_a_copy_holds_what_was_read_and_nothing_else(tmp_path):
    source, copy = Store(tmp_path / "source"), Store(tmp_path / "copy")
    for number, key in enumerate(KEYS):
        source.put(STAGE, key, one(number))
    store = Copying(source, copy)
    assert value(store, KEYS[1]) == 1
    assert [value(copy, key) for key in KEYS] == [None, 1, None]
    store.put(STAGE, KEYS[2], one(9))
    assert value(copy, KEYS[2]) == value(source, KEYS[2]) == 9


def test_a_sealed_store_makes_nothing(tmp_path):
    Store(tmp_path).put(STAGE, KEYS[0], one(1))
    sealed = Sealed(tmp_path)
    assert value(sealed, KEYS[0]) == 1
    for ask in (sealed.get, sealed.has):
        with pytest.raises(InputError, match="lacks the stage that this program would make, or it is damaged"):
            ask(STAGE, KEYS[1])
