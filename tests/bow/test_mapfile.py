import numpy as np
import pytest
from safetensors.numpy import load_file

from fdslam.bow.mapfile import load, save
from fdslam.errors import InputError

ARRAYS = {
    "a": np.arange(5, dtype=np.uint8),
    "b": np.arange(6, dtype=np.uint64).reshape(2, 3),
    "c": np.zeros(0, np.int32),
}


@pytest.fixture
def file(tmp_path):
    save(tmp_path / "map", ARRAYS, 3, {"ratio": 0.8})
    return tmp_path / "map"


def test_comes_back_mapped_and_aligned(file):
    arrays, settings = load(file, 3)
    assert settings == {"ratio": 0.8}
    for name, array in ARRAYS.items():
        assert np.array_equal(arrays[name], array)
        assert arrays[name].dtype == array.dtype
        assert arrays[name].ctypes.data % array.itemsize == 0
    assert all(np.array_equal(array, ARRAYS[name]) for name, array in load_file(file).items())


@pytest.mark.parametrize("bits", [0x01, 0x10, 0xFF])
def test_any_damage_is_named(file, bits):
    whole = file.read_bytes()
    for at in range(len(whole)):
        file.write_bytes(whole[:at] + bytes([whole[at] ^ bits]) + whole[at + 1 :])
        with pytest.raises(InputError, match=r"map: (not a map|damaged|a map of version).*build the map again"):
            load(file, 3)


def test_a_map_of_nothing_comes_back(tmp_path):
    save(tmp_path / "map", {"c": ARRAYS["c"]}, 3, {})
    assert load(tmp_path / "map", 3)[0]["c"].shape == (0,)


@pytest.mark.parametrize("size", [0, 4, 8, 60, 200, 300])
def test_a_cut_file_is_named(file, size):
    file.write_bytes(file.read_bytes()[:size])
    with pytest.raises(InputError, match=r"map: not a map, or cut short; build the map again"):
        load(file, 3)


def test_absent_and_of_another_version(file, tmp_path):
    with pytest.raises(InputError, match=r"nothing: cannot be read \(No such file"):
        load(tmp_path / "nothing", 3)
    with pytest.raises(InputError, match="version 3, this program reads version 4"):
        load(file, 4)


def test_what_is_written_to_an_array_stays_in_memory(file):
    load(file, 3)[0]["b"][0] = 7
    assert np.array_equal(load(file, 3)[0]["b"], ARRAYS["b"])
