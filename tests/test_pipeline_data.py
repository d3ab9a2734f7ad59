"""The whole way on image pairs, and on annotations of another format, with those of COCO as the oracle."""

import json
from dataclasses import replace

from fdslam.config import Evaluation, Pairs
from fdslam.pipeline import run
from fdslam.provenance import Stopwatch
from tests.data.annotations.samples import BOX, cvat
from tests.data.pair_sets import plain
from tests.data.worlds import small_world
from tests.test_pipeline import CONTROLS, ROWS, config_for, folder, table


def test_pairs_go_the_whole_way(tmp_path):
    root = plain(tmp_path / "set", count=6, changed=(1, 3))
    first = Evaluation(Y=1, bootstrap=20)
    config = config_for(Pairs(root=str(root)), tmp_path / "store", evaluation=first)
    outcome = run(config, Stopwatch())
    assert outcome.recall[1].value == 100
    assert [len(boxes) for boxes in outcome.dataset.boxes] == [0, 1, 0, 1, 0, 0]
    rows = {row.method: row for row in outcome.rows}
    assert rows.keys() == {*ROWS, *CONTROLS}
    assert rows["PC"].lc_auroc.value > 0.7  # t0 is a JPEG of noise, which costs the rest
    back = run(replace(config, dataset=Pairs(root=str(root), direction="t1_to_t0")), Stopwatch())
    assert back.dataset.query == outcome.dataset.map
    assert back.recall[1].value == 100


def test_a_folder_with_cvat_annotations_is_one_with_coco(tmp_path):
    root = small_world(tmp_path / "world", changed=(1, 2))
    config = config_for(folder(root), tmp_path / "store")
    coco = json.loads((root / "annotations.json").read_text())
    coco["annotations"][1]["bbox"] = [150, 0, 10, 15]
    (root / "annotations.json").write_text(json.dumps(coco))
    expected = table(config)
    (root / "annotations.json").unlink()
    cvat(root / "annotations.xml", BOX.replace("40.5", "40"))
    assert table(config) == expected
