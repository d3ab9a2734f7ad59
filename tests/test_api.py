"""The library. Its oracle is the pipeline on the same images in a folder, whose results it has to the last bit."""

import re
import shutil
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import cv2
import numpy as np
import pytest
import torch
from PIL import Image

from fdslam import ChangeDetector
from fdslam.config import Folder
from fdslam.data.images import read_image
from fdslam.errors import InputError
from fdslam.pipeline import run
from fdslam.provenance import Stopwatch
from fdslam.saved import ARTEFACTS
from tests.compact.walks import walk

SETTINGS = [
    "obb=j_b", "bow.features=300", "bow.min_side=240", "compact.source=gradients", "early.model=map", "early.trees=15",
    "early.leaves=8", "ad.k=2", "ad.epochs=2", "ad.folds=2", "ad.channels=4", "ad.latent=8", "ad.pixels=1024",
    "evaluation.bootstrap=10", "workers=1",
]  # fmt: skip
ROWS = ["FD", "PC", "AD", "CC", "EF", "FD+CC+EF"]


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    return walk(tmp_path_factory.mktemp("world") / "wörld", count=10)


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return tmp_path_factory.mktemp("store")


def files(folder):
    return sorted(folder.iterdir())


def made(row, store, mode="best", more=()):
    return ChangeDetector(mode, row, [*SETTINGS, *more], store)


@pytest.fixture(scope="module")
def fitted(world, store):
    """Detectors of every row, fitted once."""
    return {row: made(row, store).fit(world / "map") for row in ROWS}


@pytest.fixture(scope="module")
def outcome(world, fitted, tmp_path_factory):
    """What the pipeline says of the same images, with a store of its own: nothing is shared."""
    config = fitted["FD"].config
    mix = replace(config.mix, rows=ROWS)
    elsewhere = str(tmp_path_factory.mktemp("pipeline"))
    return run(replace(config, dataset=Folder(root=str(world)), mix=mix, store=elsewhere), Stopwatch())


def same(one, other):
    assert one.cells.dtype == other.cells.dtype
    assert np.array_equal(one.cells, other.cells)
    assert np.array_equal(one.places, other.places)
    assert np.array_equal(one.ranks, other.ranks)
    assert np.array_equal(one.localization.ranks, other.localization.ranks)
    assert [h.image for h in one.hypotheses] == [h.image for h in other.hypotheses]


@pytest.mark.parametrize("row", ROWS)
def test_the_library_finds_what_the_pipeline_finds_to_the_last_bit(row, fitted, outcome, world):
    found = fitted[row].detect_all(files(world / "query"))
    assert len(found) == 4
    for query, one in enumerate(found):
        assert one.cells.dtype == outcome.maps[row][query].dtype
        assert np.array_equal(one.cells, outcome.maps[row][query])
        assert np.array_equal(one.localization.ranks, outcome.localizations[query].ranks)
        assert [h.image for h in one.hypotheses] == outcome.hypotheses[query].tolist()
        assert [h.name for h in one.hypotheses] == [f"{m:02d}.png" for m in outcome.hypotheses[query]]
        if "+" not in row:  # what one detector finds in an image depends on no other image
            alone = fitted[row].detect(files(world / "query")[query])
            assert np.array_equal(alone.cells, one.cells)


def test_a_fused_row_of_one_image_is_the_pipelines_on_that_image(fitted, world, tmp_path):
    shutil.copytree(world / "map", tmp_path / "map")
    (tmp_path / "query").mkdir()
    shutil.copy(world / "query" / "1.png", tmp_path / "query")
    detector = fitted["FD+CC+EF"]
    config = replace(detector.config, dataset=Folder(root=str(tmp_path)), store=str(tmp_path / "store"))
    [cells] = run(config, Stopwatch()).maps["FD+CC+EF"]
    assert np.array_equal(detector.detect(world / "query" / "1.png").cells, cells)


def test_what_a_detection_says_agrees_with_itself(fitted, world):
    one = fitted["CC"].detect(world / "query" / "1.png")
    assert one.pixels.shape == (120, 160) == (one.height, one.width)
    assert one.pixels.dtype == np.float32
    assert all(one.pixels[y, x] == np.float32(one.cells[y // 10, x // 10]) for y, x in [(0, 0), (35, 50), (119, 159)])
    for hypothesis, ranks in zip(one.hypotheses, one.ranks.T, strict=True):
        assert hypothesis.relevance == pytest.approx((1 / ranks.astype(float)).sum())
    assert all(a.relevance >= b.relevance for a, b in zip(one.hypotheses, one.hypotheses[1:], strict=False))
    best = one.candidates(share=20)[0].xyxy
    x0, y0, x1, y1 = np.maximum(best[:2], (40, 30)).tolist() + np.minimum(best[2:], (100, 80)).tolist()
    assert x1 > x0 and y1 > y0, "the likeliest candidate meets what is new"  # noqa: PT018
    assert not one.lost
    assert repr(one) == f"Detection({one.name!r}, 160×120, at {one.hypotheses[0].name!r}, {len(one.obbs.xyxy)} OBBs)"


def test_numpy_and_torch_are_the_same_as_a_file(fitted, world):
    path = world / "query" / "3.png"
    image = read_image(path)
    for row in ("FD+CC+EF", "PC"):
        of_file = fitted[row].detect(path)
        tensor = torch.from_numpy(image).permute(2, 0, 1)
        for given in (image, tensor, tensor.float() / 255, image[:, ::-1][:, ::-1], Image.fromarray(image)):
            same(fitted[row].detect(given), of_file)
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    same(fitted["FD"].detect(grey), fitted["FD"].detect(np.stack([grey] * 3, axis=2)))


def test_a_map_from_memory_keeps_no_image_and_is_the_map_from_files(world):
    images = [read_image(path) for path in files(world / "map")]
    detector = made("FD+CC+EF", None).fit(images)
    assert len(detector) == len(images)
    kept = [path for frame in detector._map.dataset.map for path in frame.path.parent.glob("*")]
    assert not kept
    saved = {path.suffix for path in detector._store.root.rglob("*") if path.is_file()}
    assert saved <= {".safetensors"}
    of_files = made("FD+CC+EF", None).fit(world / "map")
    query = world / "query" / "1.png"
    assert np.array_equal(detector.detect(query).localization.ranks, of_files.detect(query).localization.ranks)


def test_a_saved_map_needs_nothing_else(world, tmp_path):
    shutil.copytree(world, tmp_path / "world")
    rows = ["PC", "AD", "FD+CC+EF"]
    expected = {}
    for row in rows:
        detector = made(row, tmp_path / "store").fit(tmp_path / "world" / "map")
        expected[row] = detector.detect_all(files(world / "query"))
        detector.save(tmp_path / "saved maps" / row)
    shutil.rmtree(tmp_path / "world")
    shutil.rmtree(tmp_path / "store")
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "saved maps").rglob("*")}
    for row in rows:
        loaded = ChangeDetector.load(tmp_path / "saved maps" / row)
        assert (loaded.row, len(loaded)) == (row, 10)
        for one, other in zip(loaded.detect_all(files(world / "query")), expected[row], strict=True):
            same(one, other)
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "saved maps").rglob("*")} == before


def test_saving_replaces_a_map_and_nothing_else(world, fitted, tmp_path):
    fitted["FD"].save(tmp_path / "map")
    fitted["FD"].save(tmp_path / "map")
    assert len(ChangeDetector.load(tmp_path / "map")) == 10
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.tex").write_text("years of work")
    with pytest.raises(InputError, match=r"other: is there and no saved map; choose a new folder"):
        fitted["FD"].save(tmp_path / "other")
    assert (tmp_path / "other" / "thesis.tex").read_text() == "years of work"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map", "other"]


def test_a_damaged_or_foreign_map_is_one_line(world, fitted, tmp_path):
    with pytest.raises(InputError, match=r"no saved map \(map\.json is not there\)"):
        ChangeDetector.load(tmp_path)
    fitted["CC"].save(tmp_path / "map")
    with pytest.raises(InputError, match=r"by a version of fdslam that computes otherwise; fit it again"):
        ChangeDetector.load(tmp_path / "map", ["compact.fine_bits=128"])
    victim = next((tmp_path / "map" / ARTEFACTS / "dense_signs").rglob("*.safetensors"))
    victim.write_bytes(victim.read_bytes()[:-1])
    with pytest.raises(InputError, match=r"the map is damaged, or .*dense_signs"):
        ChangeDetector.load(tmp_path / "map")
    manifest = tmp_path / "map" / "map.json"
    text = manifest.read_text()
    none = re.sub(r'"images": \[.*\]', '"images": []', text, flags=re.DOTALL)
    for broken in (text[:100], text.replace('"format": 1', '"format": 7'), "[]", none):
        manifest.write_text(broken)
        with pytest.raises(InputError, match=r"map\.json: .*(fit it again|fit the map again)"):
            ChangeDetector.load(tmp_path / "map")


@pytest.mark.parametrize("row", ["FD", "PC", "FD+CC+EF"])
def test_an_updated_map_is_that_of_all_images(row, world, store, fitted):
    images = files(world / "map")
    grown = made(row, store).fit(images[:6]).update(images[6:8]).update(images[8:])
    assert len(grown) == 10
    for query in files(world / "query"):
        same(grown.detect(query), fitted[row].detect(query))


def test_what_looks_at_each_image_once_grows_from_memory(world, fitted):
    images = [read_image(path) for path in files(world / "map")]
    grown = made("FD", None).fit(images[:6]).update(images[6:])
    assert [frame.name for frame in grown._map.dataset.map[5:7]] == ["000005", "000006"]
    query = world / "query" / "1.png"
    assert np.array_equal(grown.detect(query).ranks, fitted["FD"].detect(query).ranks)


def test_what_learns_from_all_images_says_that_they_are_gone(world):
    images = [read_image(path) for path in files(world / "map")]
    detector = made("CC", None).fit(images[:6])
    before = detector.detect(images[0])
    with pytest.raises(InputError, match=r"update: CC learn from all map images, and 6 are gone, the first 000000"):
        detector.update(images[6:])
    assert len(detector) == 6
    same(detector.detect(images[0]), before)


def test_threads_share_a_detector_while_it_is_updated(world, store):
    queries, images = files(world / "query"), files(world / "map")
    detector = made("FD", store).fit(images[:6])
    small = {path: detector.detect(path) for path in queries}
    large = {path: made("FD", store).fit(images).detect(path) for path in queries}
    assert any(not np.array_equal(small[path].ranks, large[path].ranks) for path in queries)
    begun = threading.Event()

    def ask(path):
        begun.set()
        return path, detector.detect(path)

    with ThreadPoolExecutor(4) as pool:
        asked = pool.map(ask, queries * 4)
        begun.wait()
        detector.update(images[6:])
        for path, one in asked:
            expected = small[path] if one.localization.ranks.shape[1] == 6 else large[path]
            same(one, expected)
    for path in queries:
        same(detector.detect(path), large[path])


def test_nothing_piles_up_and_the_program_keeps_its_threads(world, fitted, store, monkeypatch, tmp_path):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    before = sorted(store.rglob("*"))
    settings = torch.get_num_threads(), cv2.getNumThreads()
    try:
        torch.set_num_threads(2)
        cv2.setNumThreads(2)
        fitted["FD+CC+EF"].detect(read_image(world / "query" / "0.png"))
        assert (torch.get_num_threads(), cv2.getNumThreads()) == (2, 2)
    finally:
        torch.set_num_threads(settings[0])
        cv2.setNumThreads(settings[1])
    assert sorted(store.rglob("*")) == before
    assert list(tmp_path.iterdir()) == []


def test_progress_is_shown_only_if_asked_for(world, capfd):
    made("FD", None).fit(world / "map")
    assert capfd.readouterr().err == ""
    ChangeDetector("best", "FD", SETTINGS, verbose=True).fit(world / "map")
    assert "features of the map: 10/10" in capfd.readouterr().err


GOOD = np.zeros((64, 64, 3), np.uint8)


@pytest.mark.parametrize(
    ("image", "said"),
    [
        (GOOD.astype(np.float32), "float32 values; give uint8"),
        (GOOD[:, :, :2], r"an array of shape \(64, 64, 2\); an image is \[height, width, 3\]"),
        (GOOD[:8], "64×8 pixels; at least 16 on a side"),
        (torch.full((3, 64, 64), float("nan")), "floats outside 0 … 1 or NaN"),
        (torch.full((3, 64, 64), 255.0), "floats outside 0 … 1 or NaN"),
        (torch.zeros((64, 64, 3)), r"a tensor of shape \(64, 64, 3\); an image is \[3, height, width\]"),
        (None, "a NoneType is no image"),
        ("/nowhere/a.png", "no such image"),
    ],
)
def test_an_image_that_cannot_be_used_is_one_line(image, said, fitted):
    with pytest.raises(InputError, match=said) as raised:
        fitted["FD"].detect(image)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("do", "said"),
    [
        (lambda: ChangeDetector("good"), "mode=good: no such option"),
        (lambda: ChangeDetector(detectors="FD+X"), "'X' is no detector"),
        (lambda: ChangeDetector(settings=["obb"]), "'obb' is not KEY=VALUE"),
        (lambda: ChangeDetector(settings=["obb.librari=J"]), "unknown key 'obb.librari'.*obb.library"),
        (lambda: ChangeDetector(settings=["obb.yolo.weights=/no.onnx"]), "obb.yolo.weights=/no.onnx: no such file"),
        (lambda: ChangeDetector("paper", settings=SETTINGS).detect(GOOD), "there is no map yet; call fit"),
        (lambda: ChangeDetector("paper", settings=SETTINGS).save("m"), "there is no map yet"),
        (lambda: ChangeDetector("paper", settings=SETTINGS).fit([]), "no image given"),
        (lambda: ChangeDetector("paper", settings=SETTINGS).fit(GOOD), r"one array is no collection.*\[image\]"),
        (lambda: ChangeDetector("paper", settings=SETTINGS).fit(7), "a int is no collection of images"),
        (lambda: ChangeDetector("paper", settings=SETTINGS).fit("/nowhere"), "/nowhere: no such folder"),
        (
            lambda: ChangeDetector("paper", settings=SETTINGS).fit([GOOD], [[0, 0]]),
            r"poses: an array of shape \(1, 2\)",
        ),
        (
            lambda: ChangeDetector("paper", "AD", [*SETTINGS, "ad=pose"]).fit([GOOD]),
            "ad=pose: give fit the poses of the map images",
        ),
    ],
)
def test_what_the_user_can_mend_is_one_line(do, said):
    with pytest.raises(InputError, match=said) as raised:
        do()
    assert "\n" not in str(raised.value)


def test_a_map_without_a_keypoint_detects_nothing_and_says_that_it_is_lost(fitted):
    detector = made("FD", None, "tuned").fit([GOOD, GOOD + 1])
    found = detector.detect(GOOD)
    assert found.lost
    assert not found.cells.any()
