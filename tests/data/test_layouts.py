import pytest

from fdslam.config import Pairs
from fdslam.data.layouts import LAYOUTS, LOOKED_FOR, find_pairs
from fdslam.errors import InputError
from tests.data.pair_sets import SETS, pcd, plain, pscd, save, texture, vl_cmu_cd_binary, vl_cmu_cd_released, write_pair


@pytest.mark.parametrize("layout", SETS)
def test_every_layout_is_recognised(tmp_path, layout):
    root = SETS[layout](tmp_path / "set")
    found, pairs = find_pairs(root)
    assert found == layout
    assert pairs == find_pairs(root, layout)[1]
    assert len({pair.name for pair in pairs}) == len(pairs)
    for other in SETS.keys() - {layout}:
        if (other, layout) not in {("plain", "vl_cmu_cd"), ("plain", "pcd"), ("plain", "pscd")}:
            with pytest.raises(InputError, match=f"no image pairs found; looked for {other}: "):
                find_pairs(root, other)


def test_the_configuration_knows_every_layout():
    choices = Pairs.__dataclass_fields__["layout"].metadata["choices"]
    assert set(choices) == {"auto", *LAYOUTS} == {"auto", *LOOKED_FOR}


def test_plain_pairs_in_the_order_of_their_numbers(tmp_path):
    _, pairs = find_pairs(plain(tmp_path, count=11))
    assert [pair.name for pair in pairs] == [str(i) for i in range(11)]  # not 0, 1, 10, 2
    assert (pairs[10].t0, pairs[10].t1) == (tmp_path / "t0" / "10.jpg", tmp_path / "t1" / "10.png")
    assert pairs[10].mask_t0 == pairs[10].mask_t1 == tmp_path / "mask" / "10.png"
    assert {(pair.reading, pair.sequence) for pair in pairs} == {("white", None)}


def test_vl_cmu_cd_as_released(tmp_path):
    root = vl_cmu_cd_released(tmp_path)
    write_pair(0, root / "train" / "001" / "RGB" / "1_77.png", root / "train" / "001" / "RGB" / "2_77.png")
    _, pairs = find_pairs(root)
    assert [pair.name for pair in pairs] == [f"train/{s}/{i:02d}" for s in ("001", "010") for i in range(6)]
    assert [pair.sequence for pair in pairs] == ["train/001"] * 6 + ["train/010"] * 6
    assert pairs[7].t0 == root / "train/010/RGB/1_01.png"
    assert pairs[7].t1 == root / "train/010/RGB/2_01.png"
    assert pairs[7].mask_t1 == root / "train/010/GT/gt01.png"
    assert {pair.reading for pair in pairs} == {"coloured"}
    (root / "train/010/RGB/2_01.png").unlink()
    with pytest.raises(InputError, match=r"2_01\.\*: no such image, but there is .*gt01\.png"):
        find_pairs(root)


def test_vl_cmu_cd_binary_without_its_turned_copies(tmp_path):
    layout, pairs = find_pairs(vl_cmu_cd_binary(tmp_path))
    assert layout == "vl_cmu_cd"
    assert [pair.name for pair in pairs] == [
        *(f"test/2_1_{i}_0" for i in range(5)),
        *(f"test/10_1_{i}_0" for i in range(2)),
    ]
    assert [pair.sequence for pair in pairs] == ["test/2"] * 5 + ["test/10"] * 2
    assert {pair.reading for pair in pairs} == {"white"}


def test_pcd_black_in_the_released_masks_and_white_in_the_converted(tmp_path):
    _, pairs = find_pairs(pcd(tmp_path))
    assert [pair.name for pair in pairs] == [f"{part}/{i:08d}" for part in ("GSV", "TSUNAMI") for i in range(2)]
    assert {(pair.reading, pair.sequence, pair.mask_t1.suffix) for pair in pairs} == {("black", None, ".bmp")}
    assert find_pairs(tmp_path / "GSV")[1][0].name == "00000000"  # one of the two alone
    (tmp_path / "GSV" / "ground_truth").rename(tmp_path / "GSV" / "mask")
    assert [pair.reading for pair in find_pairs(tmp_path)[1]] == ["white", "white", "black", "black"]
    (tmp_path / "TSUNAMI" / "ground_truth").rename(tmp_path / "TSUNAMI" / "mask")
    layout, pairs = find_pairs(tmp_path)
    assert (layout, len(pairs), {pair.reading for pair in pairs}) == ("pcd", 4, {"white"})
    assert find_pairs(tmp_path, "plain")[1] == sorted(pairs, key=lambda pair: pair.name)


def test_pscd_has_a_mask_for_each_image(tmp_path):
    _, pairs = find_pairs(pscd(tmp_path))
    assert [(pair.mask_t0.parent.name, pair.mask_t1.parent.name) for pair in pairs] == [("mask_t0", "mask_t1")] * 2
    assert {pair.reading for pair in pairs} == {"nonzero"}


def test_changesim_from_any_folder_above_a_sequence(tmp_path):
    root = SETS["changesim"](tmp_path)
    _, pairs = find_pairs(root)
    assert [pair.name.split("/")[2:] for pair in pairs] == [
        [s, str(i)] for s in ("Seq_0", "Seq_1_dark") for i in (9, 10, 11)
    ]
    assert len({pair.sequence for pair in pairs}) == 2
    assert pairs[0].mask_t0 is None
    sequence = root / "Query_Seq_Test" / "Warehouse_6" / "Seq_0"
    layout, alone = find_pairs(sequence)
    assert (layout, [pair.name for pair in alone]) == ("changesim", ["9", "10", "11"])
    assert (alone[0].t0, alone[0].t1) == (sequence / "t0/rgb/9.png", sequence / "rgb/9.png")


@pytest.mark.parametrize("gone", ["t0/1.jpg", "t1/1.png", "mask/1.png"])
def test_a_missing_partner_is_named(tmp_path, gone):
    root = plain(tmp_path)
    (root / gone).unlink()
    folder = gone.split("/")[0]
    with pytest.raises(InputError, match=rf"{folder}/1\.\*: no such image, but there is .*/1\.\w+; add it or remove"):
        find_pairs(root)


def test_two_images_of_one_name_are_named(tmp_path):
    root = plain(tmp_path)
    save(root / "t1" / "2.bmp", texture(0))
    with pytest.raises(InputError, match=r"2\.png: 2\.bmp has the same name"):
        find_pairs(root)


def test_when_none_fits_everything_looked_for_is_named(tmp_path):
    (tmp_path / "map").mkdir()
    with pytest.raises(InputError, match="no image pairs found") as raised:
        find_pairs(tmp_path)
    for name, text in LOOKED_FOR.items():
        assert f"{name}: {text}" in str(raised.value)
    for name in ("t0", "t1", "mask"):
        (tmp_path / name).mkdir()
    with pytest.raises(InputError, match="no image pairs found"):  # folders without images
        find_pairs(tmp_path)
