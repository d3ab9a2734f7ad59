"""Photographs kept beside the project, not part of it: these tests skip where they are absent."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fdslam.config import Bow, Folder, Obb
from fdslam.data.folder import read_folder
from fdslam.mapping import BowMap
from fdslam.obb import Library
from fdslam.store import Store

SETS = Path(__file__).parent.parent.parent / "shared" / "data"
pytestmark = pytest.mark.skipif(not SETS.is_dir(), reason=f"no real images at {SETS}")


@pytest.mark.parametrize(
    ("name", "maps", "queries", "boxes"),
    [("camvid_changes", 164, 163, 223), ("camvid_generic", 164, 163, 222), ("stromovka_winter", 51, 50, 14)],
)
def test_every_set_is_read_whole(name, maps, queries, boxes):
    data = read_folder(SETS / name, Folder())
    assert data.name == name
    assert (len(data.map), len(data.query), sum(map(len, data.boxes))) == (maps, queries, boxes)
    assert all(1 <= len(places) <= 4 for places in data.relevant)  # ±3 indices, every second image is the map's


def test_a_stretch_of_street_is_localised(tmp_path):
    data = read_folder(SETS / "camvid_changes", Folder())
    data = replace(data, map=data.map[:15], query=data.query[:15])
    bow = BowMap(data.map, Bow(), Library(Obb("J+B")), Store(tmp_path), 0)
    _, found = bow.localize(data.query)
    hits = [one.strong[0] in places for one, places in zip(found, data.relevant[:15], strict=True)]
    assert np.mean(hits) > 0.8  # chance is about 0.2
