"""Several pairs of sessions in one run: what is told of them together and of each alone."""

import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import rankdata

from fdslam import pipeline
from fdslam.config import Evaluation, Folder, Mask, Mix, Report
from fdslam.data.folder import read_folder
from fdslam.pipeline import run
from fdslam.provenance import Stopwatch
from fdslam.report import write_report
from fdslam.report.data import table_csv
from fdslam.sessions import joined, label
from tests.data.worlds import small_world
from tests.test_pipeline import config_for, folder

QUICK = Evaluation(bootstrap=20, curve_Y=[1, 3])


def sessions(base):
    """Three pairs of two small worlds: A seen in B, B seen in A (another number of queries), A in B again."""
    one = read_folder(small_world(base / "one"), Folder(), name="twins")
    two = read_folder(small_world(base / "two", count=4, changed=(0,), light=0.6), Folder(), name="twins")
    return (
        replace(one, pair=("A", "B")),
        replace(two, pair=("B", "A")),
        replace(two, pair=("B", "C")),
    )


def measured(config, datasets):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pipeline, "load_datasets", lambda *_: datasets)
        return run(config, Stopwatch())


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Configuration, data sets, outcome of all three, and of each alone."""
    base = tmp_path_factory.mktemp("pairs")
    found = sessions(base)
    mix = Mix(rows=["FD", "PC", "FD+PC"])
    config = config_for(folder(base), base / "store", mix=mix, evaluation=QUICK)

    return config, found, measured(config, found), [measured(config, (one,)) for one in found]


def test_a_pair_is_measured_as_if_it_were_alone(made):
    _, _, outcome, alone = made
    assert len(outcome.pairs) == 3
    for pair, single in zip(outcome.pairs, alone, strict=True):
        assert table_csv(pair) == table_csv(single)
        assert pair.recall == single.recall
        assert single.pairs == ()


def test_the_cells_of_all_pairs_are_one_pool(made):
    _, found, outcome, alone = made
    assert len(outcome.dataset.query) == sum(len(one.query) for one in found) == 14
    pools = []
    for name in ("FD", "PC"):
        pool = np.concatenate([m.ravel() for one in alone for m in one.maps[name]])
        assert np.array_equal(np.concatenate([m.ravel() for m in outcome.maps[name]]), pool)
        pools.append(1 / rankdata(pool, method="min"))
    assert np.allclose(np.concatenate([m.ravel() for m in outcome.maps["FD+PC"]]), 2 / sum(pools))
    objects = sum(len(boxes) for boxes in outcome.dataset.boxes)
    fd = next(row for row in outcome.rows if row.method == "FD")
    assert len(fd.grades) == len(fd.found_at) == objects == 4
    for x, figure in fd.pooled.items():
        assert figure.value == pytest.approx(100 * np.mean(fd.found_at <= x))


def test_every_query_keeps_the_mask_of_its_own(made):
    config, found, _, _ = made
    masked = replace(config, mask=Mask("labels"), mix=Mix(rows=["FD"]))
    alone = [cells for one in found for cells in measured(masked, (one,)).maps["FD"]]
    together = measured(masked, found).maps["FD"]
    assert all(np.array_equal(a, b) for a, b in zip(together, alone, strict=True))
    assert all((cells[:3] == 0).all() for cells in together)  # sky


def test_recall_and_kept_bytes_are_those_of_all_queries_and_maps(made):
    _, _, outcome, alone = made
    for n, figure in outcome.recall.items():
        hits = sum(one.recall[n].value * len(one.dataset.query) for one in alone)
        assert figure.value == pytest.approx(hits / 14)
    for name, kept in outcome.kept.items():
        assert kept == pytest.approx(sum(one.kept[name] * len(one.dataset.map) for one in alone) / 14)


def test_names_and_hypotheses_tell_the_pairs_apart(made):
    _, found, outcome, alone = made
    names = [frame.name for frame in outcome.dataset.query]
    assert len(set(names)) == len(names)
    assert names[6] == "query/00.png (B/A)"
    assert names[10] == "query/00.png (B/C)"
    shown = [outcome.dataset.map[h[0]].digest for h in outcome.hypotheses]
    expected = [one.dataset.map[h[0]].digest for one in alone for h in one.hypotheses]
    assert shown == expected
    assert [ids.tolist() for ids in outcome.dataset.relevant[6:10]] == [[6], [7], [8], [9]]
    assert joined(found[:1]) is found[0]
    assert label(replace(found[0], pair=None)) == ""


def test_truth_that_one_pair_lacks_is_left_out(made):
    _, found, _, _ = made
    assert joined([found[0], replace(found[1], boxes=None, relevant=None)]).boxes is None
    assert joined([found[0], replace(found[1], boxes=None, relevant=None)]).relevant is None


def test_the_curve_over_y_is_what_a_run_at_that_y_finds(made):
    config, found, outcome, _ = made
    assert sorted(outcome.over_Y) == [1, 3]
    other = measured(replace(config, evaluation=replace(QUICK, Y=3, curve_Y=[])), found)
    for row, again in zip(outcome.over_Y[3], other.rows[:3], strict=True):
        assert {x: f.value for x, f in row.pooled.items()} == {x: f.value for x, f in again.pooled.items()}


def test_the_report_tells_of_every_pair(made, tmp_path):
    config, _, outcome, _ = made
    text = write_report(outcome, replace(config, report=Report(pictures=1)), tmp_path, Stopwatch())
    assert "twins, 3 pairs of sessions: 6 map images, 14 queries, 4 changed objects" in text
    assert "B/C" in text
    table = json.loads((tmp_path / "table.json").read_text())
    assert [(p["query_session"], p["map_session"]) for p in table["pairs"]] == [("A", "B"), ("B", "A"), ("B", "C")]
    for pair, single in zip(table["pairs"], outcome.pairs, strict=True):
        assert [row["method"] for row in pair["rows"]] == [row["method"] for row in table["rows"]]
        assert pair["rows"][0]["pooled"]["20"]["value"] == single.rows[0].pooled[20].value
    assert table["over_Y"]["3"]["FD"]["20"] == outcome.over_Y[3][0].pooled[20].value
    lines = list(csv.DictReader(io.StringIO((tmp_path / "pairs.csv").read_text())))
    mine = [line for line in lines if (line["query"], line["map"], line["method"]) == ("B", "C", "PC")]
    value = next(line["value"] for line in mine if line["figure"] == "top-20" and line["pool"] == "all")
    assert float(value) == outcome.pairs[2].rows[1].pooled[20].value
    assert "| B/A | 4 | 1 | " in (tmp_path / "table.md").read_text()
    assert (tmp_path / "curves.png").stat().st_size > 10_000


def test_pairs_without_annotations_have_no_part_in_the_table(made, tmp_path):
    config, found, _, alone = made
    bare = replace(found[2], boxes=None)
    outcome = measured(config, (found[0], found[1], bare))
    both = measured(config, found[:2])
    assert table_csv(outcome) == table_csv(both)
    assert outcome.over_Y.keys() == both.over_Y.keys()
    assert [len(pair.rows) > 0 for pair in outcome.pairs] == [True, True, False]
    assert table_csv(outcome.pairs[0]) == table_csv(alone[0])
    text = write_report(outcome, replace(config, report=Report(pictures=0)), tmp_path, Stopwatch())
    assert "1 of 3 pairs are not annotated and have no part in what follows" in text
    assert "| B/C | 4 | – | " in (tmp_path / "table.md").read_text()
    none = measured(config, tuple(replace(one, boxes=None) for one in found))
    assert none.rows == ()
    assert none.over_Y == {}
    text = write_report(none, replace(config, report=Report(pictures=0)), tmp_path / "none", Stopwatch())
    assert "no annotations" in text
    assert not (tmp_path / "none" / "curves.png").exists()


def test_one_image_against_two_maps_is_drawn_as_one(made):
    config, found, _, _ = made
    twice = measured(config, (found[1], replace(found[1], pair=("B", "C"))))
    once = measured(config, found[1:2])
    for row, single in zip(twice.rows, once.rows, strict=True):
        assert row.method == single.method
    centre = {row.method: row.pooled[20] for row in twice.rows}["centre blob"]
    alone = {row.method: row.pooled[20] for row in once.rows}["centre blob"]
    assert (centre.low, centre.high) == (alone.low, alone.high)  # as wide as with half the queries
    assert twice.recall == once.recall
