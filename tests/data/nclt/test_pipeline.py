"""The whole way on NCLT: the oracle is the same images, turned upright beforehand, as a folder."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from experiments.table1.campus_as_nclt import utime, write_campus
from fdslam.config import Campus, Evaluation, Mix, Nclt
from fdslam.data import load_datasets
from fdslam.data.images import read_image
from fdslam.data.nclt.sessions import SEASONS
from fdslam.pipeline import run
from fdslam.provenance import Stopwatch
from fdslam.report.data import pairs_csv, table_csv
from fdslam.store import Store
from fdslam.types import Dataset
from tests.data.worlds import write_csv
from tests.test_pipeline import config_for, folder, table

SETTINGS = Campus(images=40, width=154, height=202, objects=60, distractors=36)
DATES = {"map": SEASONS["SU"], "query": SEASONS["AU"]}
LOOK = {"query": "AU", "map": "SU", "every": 0.0}


def as_folder(root: Path, data: Dataset, raw: Path) -> Path:
    """Lay ``data`` out as a folder of upright images, under names of its own: names decide nothing."""
    rows = {}
    for session, frames in (("map", data.map), ("query", data.query)):
        (root / session).mkdir(parents=True)
        for frame in frames:
            upright = np.rot90(read_image(raw / frame.name), -1)
            cv2.imwrite(str(root / session / f"{Path(frame.name).stem}.png"), upright[..., ::-1])
        poses = (raw / "ground_truth" / f"groundtruth_{DATES[session]}.csv").read_text().splitlines()
        cells = [line.split(",") for line in poses]
        rows[session] = [[f"{session}/{c[0]}.png", "d", i, c[1], c[2], c[6]] for i, c in enumerate(cells)]
    write_csv(root / "map.csv", ["map_file", "drive", "index", "x", "y", "heading"], rows["map"])
    write_csv(root / "pairs.csv", ["query_file", "drive", "query_index", "x", "y", "heading"], rows["query"])
    coco = (raw / "annotations" / f"{DATES['query']}_{DATES['map']}.json").read_text()
    coco = coco.replace(f"{DATES['query']}/lb3/Cam5", "query").replace(".tiff", ".png")
    (root / "annotations.json").write_text(coco)
    return root


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A campus as NCLT: its folder, the configuration of a run on it, and what that found."""
    raw, store = tmp_path_factory.mktemp("raw"), tmp_path_factory.mktemp("store")
    config = config_for(Nclt(root=str(raw), **LOOK), store)
    write_campus(raw, SETTINGS, Store(store))
    return raw, config, run(config, Stopwatch())


def test_the_same_table_as_from_a_folder_of_upright_images(made, tmp_path):
    raw, config, outcome = made
    assert sum(map(len, outcome.dataset.boxes)) > 0
    plain = as_folder(tmp_path / "folder", outcome.dataset, raw)
    assert table_csv(outcome) == table(config_for(folder(plain), tmp_path / "store"))
    assert table(replace(config, workers=1)) == table_csv(outcome)  # from the store


def test_the_campus_as_nclt_is_the_campus(made):
    _, config, ours = made
    campus = run(replace(config, dataset=SETTINGS), Stopwatch())
    for a, b in ((ours.dataset.boxes, campus.dataset.boxes), (ours.dataset.relevant, campus.dataset.relevant)):
        assert [x.tolist() for x in a] == [x.tolist() for x in b]
    assert ours.dataset.times.tolist() == campus.dataset.times.tolist()
    np.testing.assert_allclose(ours.dataset.poses, campus.dataset.poses, atol=1e-9)
    for a, b in zip(ours.dataset.map + ours.dataset.query, campus.dataset.map + campus.dataset.query, strict=True):
        np.testing.assert_array_equal(read_image(a.path), read_image(b.path))
    assert len(ours.rows) > 0
    assert table_csv(ours) == table_csv(campus)


def test_table_1_of_the_campus_as_nclt_is_that_of_the_campus(tmp_path):
    settings = replace(SETTINGS, images=24, objects=24, distractors=24, all_pairs=True)
    store = Store(tmp_path / "store")
    write_campus(tmp_path / "raw", settings, store)
    config = config_for(settings, store.root, mix=Mix(rows=["FD", "PC", "FD+PC"]), evaluation=Evaluation(bootstrap=20))
    campus = run(config, Stopwatch())
    ours = run(replace(config, dataset=Nclt(root=str(tmp_path / "raw"), every=0.0, all_pairs=True)), Stopwatch())
    assert len(ours.pairs) == 12
    assert table_csv(ours) == table_csv(campus)
    assert pairs_csv(ours) == pairs_csv(campus)


def test_an_image_that_changes_is_seen(tmp_path):
    """A store that trusts size and date must not go on with the old image."""
    write_campus(tmp_path / "raw", replace(SETTINGS, images=12), Store(tmp_path / "campus"))
    settings, store = Nclt(root=str(tmp_path / "raw"), **LOOK), Store(tmp_path / "store")
    [before] = load_datasets(settings, store, 1)
    path = tmp_path / "raw" / DATES["map"] / "lb3" / "Cam5" / f"{utime(DATES['map'], 1)}.tiff"
    Image.fromarray(np.rot90(read_image(before.map[0].path)).copy()).save(path)
    [after] = load_datasets(settings, store, 1)
    assert after.map[1].digest == before.map[0].digest != before.map[1].digest
    assert json.dumps([f.digest for f in after.query]) == json.dumps([f.digest for f in before.query])
