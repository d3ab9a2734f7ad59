"""The whole way on small worlds. Where a second run is compared with a first, the first is the oracle."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from safetensors.numpy import load_file

from fdslam.bow.index import InvertedFile
from fdslam.bow.vocabulary import Vocabulary
from fdslam.config import Ad, Bow, Campus, Config, Evaluation, Fd, Folder, Mask, Mix, Obb, Report
from fdslam.config import Vocabulary as Switches
from fdslam.errors import InputError
from fdslam.pipeline import run
from fdslam.provenance import Stopwatch
from fdslam.report.data import table_csv
from tests import reference
from tests.data.worlds import small_world, texture, write_csv
from tests.test_config import composed

QUICK = Ad(k=2, epochs=2, folds=2, channels=4, latent=8, pixels=1024)
ROWS = ["FD", "PC", "AD", "FD+AD+PC", "FD+AD", "FD+PC"]
CONTROLS = ["random", "smooth random", "centre blob", "objectness"]


def config_for(data, store, **changes):
    plain = Config(
        store=str(store),
        dataset=data,
        obb=Obb("J+B"),
        bow=Bow(features=300, min_side=240),
        ad=QUICK,
        mix=Mix(rows=ROWS),
        evaluation=Evaluation(bootstrap=20),
        report=Report(pictures=0),
    )
    return replace(plain, **changes)


def folder(root):
    return Folder(root=str(root))


def table(config):
    return table_csv(run(config, Stopwatch()))


def artefacts(store):
    return {path: path.stat().st_mtime_ns for path in store.rglob("*.safetensors")}


@pytest.fixture(scope="module")
def campus(tmp_path_factory):
    """A run on a small campus: configuration, outcome."""
    data = Campus(images=56, width=154, height=202)
    config = config_for(data, tmp_path_factory.mktemp("campus") / "store")
    return config, run(config, Stopwatch())


def _bytes_of_the_map(config):
    """What words and postings weigh, built anew from the stored words of every map image."""
    posted = [load_file(path)["words"] for path in (Path(config.store) / "vocabulary").rglob("*.safetensors")]
    vocabulary = Vocabulary(Switches())
    vocabulary.append(np.zeros((len(np.unique(np.concatenate(posted))), 32), np.uint8))
    for _ in posted[1:]:
        vocabulary.append(np.zeros((0, 32), np.uint8))
    stored = InvertedFile.from_arrays(InvertedFile(posted, len(vocabulary)).arrays())  # without room for more
    return vocabulary.nbytes + stored.nbytes


def test_campus_end_to_end(campus):
    _config, outcome = campus
    assert [row.method for row in outcome.rows] == ROWS + CONTROLS
    assert sum(map(len, outcome.dataset.boxes)) > 0
    assert any(len(boxes) == 0 for boxes in outcome.dataset.boxes)
    assert outcome.recall[10].value >= outcome.recall[5].value >= outcome.recall[1].value > 20
    for row in outcome.rows:
        assert 0 <= row.pooled[5].value <= row.pooled[20].value <= 100
        assert row.pooled[20].low <= row.pooled[20].value <= row.pooled[20].high
        assert 0 <= row.lc_auroc.value <= 1
    for maps in outcome.maps.values():
        assert [m.shape for m in maps] == [(21, 16)] * len(outcome.dataset.query)
        assert all(np.isfinite(m).all() for m in maps)
    blob = next(row for row in outcome.rows if row.method == "centre blob")
    assert blob.lc_auroc.value == pytest.approx(0.5)
    assert set(outcome.leaders) == set(ROWS)
    assert outcome.kept["FD"] == 0
    assert outcome.kept["bag of words"] == _bytes_of_the_map(_config) / len(outcome.dataset.map)
    assert outcome.kept["PC"] > outcome.kept["bag of words"] > 0
    assert outcome.kept["AD"] > 0


def test_a_second_run_computes_nothing_and_says_the_same(campus):
    config, outcome = campus
    before = artefacts(Path(config.store))
    again = run(config, Stopwatch())
    assert artefacts(Path(config.store)) == before
    assert table_csv(again) == table_csv(outcome)


@pytest.mark.parametrize(
    ("changes", "stages"),
    [
        ({"mix": Mix(rows=["FD+AD"])}, set()),
        ({"mix": Mix(rows=["FD", "AD", "FD+AD"], rule="reciprocal")}, set()),
        ({"evaluation": Evaluation(X=[1, 50], bootstrap=10)}, set()),
        ({"evaluation": Evaluation(Y=3, bootstrap=10)}, {"fd", "pc"}),
        ({"ad": replace(QUICK, c=0.1)}, set()),
        ({"mask": Mask("labels")}, set()),
        ({"dataset": Campus(images=56, width=154, height=202, radius=4.0)}, set()),
        ({"obb": Obb("A+J")}, {"localization", "fd", "pc", "ad"}),
        ({"fd": Fd(gate=2, weights="area")}, {"fd"}),
        ({"fd": Fd(support=1.0)}, {"fd", "word_support"}),
        ({"fd": Fd(support=0.5, support_distance=50)}, {"fd"}),
        ({"mix": Mix(rows=["FD+PC"], rule="stouffer")}, set()),
        ({"ad": replace(QUICK, k=3)}, {"places", "autoencoder", "autoencoder_summary", "ad"}),
    ],
)
def test_a_change_repeats_only_what_is_new(campus, changes, stages):
    config, _ = campus
    store = Path(config.store)
    before = artefacts(store)
    run(replace(config, **changes), Stopwatch())
    after = artefacts(store)
    assert {path: after[path] for path in before} == before
    new = {path.relative_to(store).parts[0] for path in after.keys() - before.keys()}
    assert new <= stages
    assert stages - {"pc", "ad"} <= new  # hypotheses that stay the same leave pc and ad as they are


@pytest.mark.parametrize("c", [1e-6, 0.05, 0.8 / 3, 1e6])
def test_c_is_shared_and_changes_no_figure(campus, c):
    config, outcome = campus
    other = replace(config, ad=replace(QUICK, c=c))
    assert table_csv(run(other, Stopwatch())) == table_csv(outcome)


def test_paper_mode_is_the_equation_pixel_by_pixel(campus):
    config, outcome = campus
    assert config.fd == Fd() == composed("mode=paper").fd
    rows = slice(4, 8)  # of cells: the loop is slow, and a pixel's J[p] does not depend on how many others are visited
    for query in (0, len(outcome.dataset.query) - 1):
        found, top = outcome.localizations[query], outcome.hypotheses[query]
        assert len(top) == 10
        up = found.boxes.xyxy - (0, 40, 0, 40)
        pixels = reference.fault_diagnosis(
            up, found.ranks[:, top].tolist(), 40, 154, "min", "fuse_then_pool", "harmonic"
        )
        expected = reference.cell_maximum(pixels, 10)
        assert len(np.unique(expected)) > 3
        assert np.allclose(outcome.maps["FD"][query][rows], expected, rtol=1e-6, atol=0)


def test_tuned_keeps_no_more_than_words_and_their_places(campus):
    config, plain = campus
    tuned = composed("mode=tuned")
    changed = replace(config, mode="tuned", fd=tuned.fd, pc=tuned.pc, mix=Mix(rows=["FD"], rule=tuned.mix.rule))
    outcome = run(changed, Stopwatch())
    placed = 12 * np.mean([len(load_file(p)["words"]) for p in (Path(config.store) / "vocabulary").rglob("*.safe*")])
    assert outcome.kept == {"bag of words": plain.kept["bag of words"], "FD": pytest.approx(placed)}
    for cells in outcome.maps["FD"]:
        assert set(np.unique(cells[cells < 1])) <= {0}
        assert 1 < cells.max() <= 2 + tuned.fd.support
    alone = replace(changed, workers=1, store=f"{config.store}-tuned")
    assert table(alone) == table_csv(outcome)
    files = sorted(Path(alone.store).rglob("*.safetensors"))
    for path in files[::2]:
        path.unlink()
    assert table(alone) == table_csv(outcome)


LISTS = {"localization", "fd"}
WORDS = LISTS | {"vocabulary", "words", "map"}


@pytest.mark.parametrize(
    ("switch", "stages"),
    [
        ({"islands": "ibow"}, LISTS),
        ({"verify_top": 3, "verify_inliers": 12}, LISTS),
        ({"document": "obb"}, LISTS | {"map"}),
        ({"purge": True}, WORDS),
        ({"second": "other_place"}, WORDS),
    ],
)
def test_every_refinement_goes_the_whole_way(campus, switch, stages):
    config, plain = campus
    changed = replace(config, bow=replace(config.bow, **switch), mix=Mix(rows=["FD"]))
    store = Path(config.store)
    before = artefacts(store)
    outcome = run(changed, Stopwatch())
    assert {path.relative_to(store).parts[0] for path in artefacts(store).keys() - before.keys()} == stages
    pairs = zip(outcome.localizations, plain.localizations, strict=True)
    assert any(not np.array_equal(a.ranks, b.ranks) for a, b in pairs)
    assert outcome.recall[5].value > 20
    kept, whole = outcome.kept["bag of words"], plain.kept["bag of words"]
    assert {"verify_top": kept > whole + 300 * 40 * 0.9, "purge": kept < whole}.get(next(iter(switch)), True)
    alone = replace(changed, workers=1, store=str(store.parent / f"alone-{next(iter(switch))}"))
    assert table(alone) == table_csv(outcome)


def test_workers_and_a_damaged_store_change_nothing(campus, tmp_path):
    config, outcome = campus
    expected = table_csv(outcome)
    assert table(replace(config, store=str(tmp_path), workers=1)) == expected
    files = sorted(Path(tmp_path).rglob("*.safetensors"))
    for path in {*files[::3], *(tmp_path / "map").rglob("*.safetensors")}:
        path.write_bytes(path.read_bytes()[:-7])
    for path in files[1::3]:
        path.unlink()
    next(path for path in Path(tmp_path).rglob("AU/0001.png") if path.parents[1].name != "labels").write_bytes(b"torn")
    assert table(replace(config, store=str(tmp_path), workers=3)) == expected


def test_the_order_of_the_queries_changes_nothing(tmp_path):
    root = small_world(tmp_path / "world")
    config = config_for(folder(root), tmp_path / "store")
    plain = table(config)
    with (root / "pairs.csv").open() as file:
        header, *rows = csv.reader(file)
    write_csv(root / "pairs.csv", header, [rows[i] for i in (3, 0, 5, 1, 4, 2)])
    assert table(config) == plain


def test_a_copy_of_the_map_shows_change_only_where_something_was_pasted(tmp_path):
    root = small_world(tmp_path / "world", count=8, changed=(1, 4), light=1.0)
    outcome = run(config_for(folder(root), tmp_path / "store"), Stopwatch())
    assert outcome.recall[1].value == 100
    row, column = np.mgrid[:12, :16]
    # Further from the patch (x 40-80, y 60-100) than any SIFT reaches that was found here.
    far = (np.abs(column * 10 + 5 - 60) > 70) | (np.abs(row * 10 + 5 - 80) > 70)
    for query, boxes in enumerate(outcome.dataset.boxes):
        fd, pc = outcome.maps["FD"][query], outcome.maps["PC"][query]
        if len(boxes):
            assert fd.max() >= 1
            assert pc[6:10, 4:8].max() > 100
            assert pc[far].max() < 5  # the pyramid below a SIFT reaches further, a rounding at most
        else:
            assert (fd == 1).all()  # every OBB puts the same map image first
            assert (pc == 0).all()


def test_without_annotations_there_are_maps_and_no_table(tmp_path):
    root = small_world(tmp_path / "world")
    for name in ("annotations.json", "map.csv", "pairs.csv"):
        (root / name).unlink()
    outcome = run(config_for(folder(root), tmp_path / "store"), Stopwatch())
    assert outcome.rows == ()
    assert outcome.recall[1] is None
    assert len(outcome.maps["FD+AD+PC"]) == 6


def test_a_query_and_a_map_image_without_keypoints_are_no_error(tmp_path):
    root = small_world(tmp_path / "world")
    for name in ("query/01.png", "map/04.png"):
        Image.fromarray(np.full((120, 160, 3), 90, np.uint8)).save(root / name)
    outcome = run(config_for(folder(root), tmp_path / "store"), Stopwatch())
    assert outcome.localizations[1].boxes.xyxy.shape == (0, 4)
    assert (outcome.maps["FD"][1] == 0).all()
    assert outcome.localizations[1].lost
    assert not outcome.localizations[0].lost


def test_a_query_that_says_nothing_is_not_localised(tmp_path):
    # Its strong list begins with map id 0, where it happens to be.
    root = small_world(tmp_path / "world")
    Image.fromarray(np.full((120, 160, 3), 90, np.uint8)).save(root / "query" / "00.png")
    outcome = run(config_for(folder(root), tmp_path / "store"), Stopwatch())
    assert outcome.recall[1].value == pytest.approx(100 * 5 / 6)
    rows = {row.method: row for row in outcome.rows}
    assert rows["objectness"].lc_auroc.value == 0.5  # templates are a fixed map, whatever the query holds


def test_blank_images_leave_every_map_finite(tmp_path):
    root = small_world(tmp_path / "world")
    for name in ("query/01.png", "map/04.png"):
        Image.fromarray(np.full((120, 160, 3), 90, np.uint8)).save(root / name)
    outcome = run(config_for(folder(root), tmp_path / "store"), Stopwatch())
    assert all(np.isfinite(m).all() for maps in outcome.maps.values() for m in maps)


def test_a_map_of_one_image(tmp_path):
    root = small_world(tmp_path / "world")
    write_csv(root / "map.csv", ["map_file", "drive", "index"], [["map/01.png", "d", 10]])
    outcome = run(config_for(folder(root), tmp_path / "store"), Stopwatch())
    assert all(found.strong.tolist() == [0] for found in outcome.localizations)
    assert all((m <= 1).all() for m in outcome.maps["FD"])  # one rank there is: nothing can disagree


def test_images_of_different_sizes(tmp_path):
    root = small_world(tmp_path / "world")
    Image.fromarray(texture(2, 150, 131)).save(root / "query" / "02.png")
    Image.fromarray(texture(5, 100, 90)).save(root / "map" / "05.png")
    coco = json.loads((root / "annotations.json").read_text())
    coco["images"][2].update(width=131, height=150)
    (root / "annotations.json").write_text(json.dumps(coco))
    outcome = run(config_for(folder(root), tmp_path / "store"), Stopwatch())
    assert outcome.maps["FD+AD+PC"][2].shape == (15, 14)


def test_the_true_viewpoint(tmp_path):
    root = small_world(tmp_path / "world")
    write_csv(root / "map.csv", ["map_file", "drive", "index"], [[f"map/{i:02d}.png", "d", 10 * i] for i in range(5)])
    true = Evaluation(viewpoint="true", bootstrap=10)
    config = config_for(folder(root), tmp_path / "store", evaluation=true)
    outcome = run(config, Stopwatch())
    assert [h.tolist() for h in outcome.hypotheses] == [[0], [1], [2], [3], [4], []]
    for method in ("FD", "PC", "AD"):
        assert (outcome.maps[method][5] == 0).all()  # its place is not in the map
    (root / "pairs.csv").unlink()
    with pytest.raises(InputError, match="no place ground truth"):
        run(config, Stopwatch())


def test_places_by_pose_need_poses(tmp_path):
    config = config_for(folder(small_world(tmp_path / "world")), tmp_path / "store", ad=replace(QUICK, places="pose"))
    with pytest.raises(InputError, match="no poses"):
        run(config, Stopwatch())
    assert table(replace(config, ad=replace(QUICK, places="time"))).startswith("method,")
