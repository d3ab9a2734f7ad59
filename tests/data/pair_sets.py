"""Tiny sets of image pairs in the exact layouts of the published ones: pair i shows place i, with a patch in t1."""

import numpy as np
from PIL import Image

from tests.data.worlds import texture

HEIGHT, WIDTH = 120, 160
PATCH = (slice(60, 100), slice(40, 80))  # rows, columns
BOX = [40, 60, 80, 100]


def mask_of(changed, low=0, high=255):
    mask = np.full((HEIGHT, WIDTH), low, np.uint8)
    if changed:
        mask[PATCH] = high
    return mask


def coloured(changed, colour, ground=(0, 0, 0)):
    return np.where(mask_of(changed)[..., None] > 0, np.uint8(colour), np.uint8(ground))


def save(path, array):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.asarray(array, np.uint8)).save(path)
    return path


def write_pair(place, t0, t1, changed=True):
    before = texture(place, HEIGHT, WIDTH)
    after = (before * 0.8).astype(np.uint8)
    if changed:
        after[PATCH] = texture(100 + place, HEIGHT, WIDTH)[PATCH]
    save(t0, before)
    save(t1, after)


def plain(root, count=4, changed=(1, 3)):
    for i in range(count):
        write_pair(i, root / "t0" / f"{i}.jpg", root / "t1" / f"{i}.png", i in changed)
        save(root / "mask" / f"{i}.png", mask_of(i in changed))
    return root


def vl_cmu_cd_released(root, sequences=("001", "010")):
    for s, name in enumerate(sequences):
        for i in range(6):
            rgb = root / "train" / name / "RGB"
            write_pair(10 * s + i, rgb / f"1_{i:02d}.png", rgb / f"2_{i:02d}.png", i % 2)
            mask = coloured(i % 2, (136, 0, 21))
            mask[:30] = 255  # the sky
            save(root / "train" / name / "GT" / f"gt{i:02d}.png", mask)
    return root


def vl_cmu_cd_binary(root):
    for sequence, count in (("2", 5), ("10", 2)):
        for i in range(count):
            for turn in range(4):
                name = f"{sequence}_1_{i}_{turn}.png"
                write_pair(i, root / "test" / "t0" / name, root / "test" / "t1" / name)
                save(root / "test" / "mask" / name, mask_of(True))
    return root


def pcd(root):
    for s, part in enumerate(("TSUNAMI", "GSV")):
        for i in range(2):
            write_pair(10 * s + i, root / part / "t0" / f"{i:08d}.jpg", root / part / "t1" / f"{i:08d}.jpg", i)
            save(root / part / "ground_truth" / f"{i:08d}.bmp", coloured(i, (0, 0, 0), (255, 255, 255)))
    return root


def pscd(root):
    for i in range(2):
        write_pair(i, root / "t0" / f"p{i}.png", root / "t1" / f"p{i}.png")
        save(root / "mask_t0" / f"p{i}.png", np.roll(mask_of(True, high=7), 20, axis=1))
        save(root / "mask_t1" / f"p{i}.png", mask_of(True, high=3))
    return root


def changesim(root):
    for sequence in ("Seq_0", "Seq_1_dark"):
        base = root / "Query_Seq_Test" / "Warehouse_6" / sequence
        for i in (9, 10, 11):
            write_pair(i, base / "t0" / "rgb" / f"{i}.png", base / "rgb" / f"{i}.png", i != 9)
            save(base / "change_segmentation" / f"{i}.png", coloured(i != 9, (131, 192, 13)))
    return root


SETS = {
    "plain": plain,
    "vl_cmu_cd": vl_cmu_cd_released,
    "pcd": pcd,
    "pscd": pscd,
    "changesim": changesim,
}
