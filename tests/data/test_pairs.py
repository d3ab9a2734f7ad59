import numpy as np
import pytest

from fdslam.config import Pairs
from fdslam.data import images
from fdslam.data.pairs import read_pairs
from fdslam.errors import InputError
from tests.data.pair_sets import (
    BOX,
    HEIGHT,
    SETS,
    WIDTH,
    changesim,
    mask_of,
    pcd,
    plain,
    pscd,
    save,
    vl_cmu_cd_binary,
    vl_cmu_cd_released,
)


def read(root, **settings):
    return read_pairs(Pairs(root=str(root), **settings))


def test_plain_pairs(tmp_path, caplog):
    caplog.set_level("INFO")
    data = read(plain(tmp_path / "set"))
    assert (data.name, data.labels, data.poses, data.pair) == ("set", None, None, None)
    assert [f.name for f in data.map] == [f"t0/{i}.jpg" for i in range(4)]
    assert [f.name for f in data.query] == [f"t1/{i}.png" for i in range(4)]
    assert (data.query[0].height, data.query[0].width, len(data.query[0].digest)) == (HEIGHT, WIDTH, 64)
    assert [b.tolist() for b in data.boxes] == [[], [BOX], [], [BOX]]  # an empty mask: nothing changed
    assert [r.tolist() for r in data.relevant] == [[0], [1], [2], [3]]
    assert data.times.tolist() == [0, 1, 2, 3]
    assert "4 pairs, layout plain" in caplog.text


@pytest.mark.parametrize("layout", SETS)
def test_every_layout_gives_its_boxes(tmp_path, layout):
    data = read(SETS[layout](tmp_path))
    assert {tuple(box) for boxes in data.boxes for box in boxes.tolist()} == {tuple(BOX)}
    assert len(data.map) == len(data.query) == len(data.boxes) == len(data.relevant) == len(data.times)


def test_sequences_have_neighbours_and_stay_apart(tmp_path):
    data = read(vl_cmu_cd_released(tmp_path), tolerance=2)
    assert [r.tolist() for r in data.relevant[:3]] == [[0, 1, 2], [1, 0, 2, 3], [2, 1, 3, 0, 4]]
    assert data.relevant[6].tolist() == [6, 7, 8]
    assert np.diff(data.times).tolist() == [1] * 5 + [data.times[6] - 5] + [1] * 5
    assert data.times[6] > 1e5
    assert [r.tolist() for r in read(tmp_path, tolerance=0).relevant] == [[i] for i in range(12)]


def test_what_is_left_out_is_said(tmp_path, caplog):
    assert len(read(plain(tmp_path / "plain")).query) == 4
    assert "left out" not in caplog.text
    assert len(read(vl_cmu_cd_binary(tmp_path / "vl")).query) == 7
    assert "63 images and masks are in no pair and left out" in caplog.text  # three turned copies of each of 7 pairs


def test_the_other_direction_swaps_map_and_queries(tmp_path):
    data = read(pscd(tmp_path / "pscd"), direction="t1_to_t0")
    assert [f.name for f in data.map] == ["t1/p0.png", "t1/p1.png"]
    assert [f.name for f in data.query] == ["t0/p0.png", "t0/p1.png"]
    assert [b.tolist() for b in data.boxes] == [[[60, 60, 100, 100]]] * 2  # mask_t0, which is shifted
    with pytest.raises(InputError, match="changesim has masks for t1 alone; choose direction=t0_to_t1"):
        read(changesim(tmp_path / "changesim"), direction="t1_to_t0")


def test_black_and_white_taken_for_each_other_are_said(tmp_path):
    root = pcd(tmp_path)
    for part in ("GSV", "TSUNAMI"):
        (root / part / "ground_truth").rename(root / part / "mask")  # not converted, though named so
    with pytest.raises(InputError, match=r"read as pcd, 9\d % of all pixels .* dataset\.changed=black"):
        read(root)
    assert [b.tolist() for b in read(root, changed="black").boxes] == [[], [BOX], [], [BOX]]
    assert len(read(root, changed="white").boxes[0]) == 1


def test_small_areas_are_no_object(tmp_path):
    assert sum(map(len, read(plain(tmp_path), min_area=1600).boxes)) == 2
    assert sum(map(len, read(tmp_path, min_area=1601).boxes)) == 0


@pytest.mark.parametrize(
    ("name", "array", "said"),
    [
        ("mask/1.png", mask_of(True)[:-1], r"mask/1\.png: the mask is 160×119 pixels, its image t1/1\.png 160×120"),
        ("mask/1.png", mask_of(True, high=128), r"mask/1\.png: holds the values 0, 128"),
        ("t1/1.png", np.zeros((8, 8)), r"t1/1\.png: 8×8 pixels is too small"),
    ],
)
def test_faults_are_named(tmp_path, name, array, said):
    root = plain(tmp_path)
    save(root / name, array)
    with pytest.raises(InputError, match=said):
        read(root)


def test_a_huge_image_is_refused_before_it_is_decoded(tmp_path, monkeypatch):
    root = plain(tmp_path)
    monkeypatch.setattr(images, "MAX_PIXELS", HEIGHT * WIDTH - 1)
    with pytest.raises(InputError, match=r"t0/\d\.jpg: 160×120 pixels is above the limit"):
        read(root)


def test_workers_change_nothing(tmp_path):
    root = vl_cmu_cd_binary(tmp_path)
    one, many = (read_pairs(Pairs(root=str(root)), workers) for workers in (1, 4))
    assert (one.map, one.query) == (many.map, many.query)
    assert [b.tolist() for b in one.boxes] == [b.tolist() for b in many.boxes]


def test_wide_panoramas_are_fine(tmp_path):
    for folder, array in (
        ("t0", np.zeros((112, 2048, 3))),
        ("t1", np.ones((112, 2048, 3))),
        ("mask", np.zeros((112, 2048))),
    ):
        save(tmp_path / folder / "00000001.png", array)
    data = read(tmp_path)
    assert (data.query[0].width, data.boxes[0].shape) == (2048, (0, 4))
