"""The benchmarks' contract: what they print and write, on a map of a few images; never how fast it is."""

import json
import statistics
import sys

import pytest

from experiments.speed import autoencoders, compact, comparison, kernels, localization, query, stages, update
from fdslam.localization import localize
from tests.compact.walks import config_for, walk
from tests.test_api import SETTINGS


def test_localization_writes_the_figures_that_are_promised(monkeypatch, tmp_path, capsys):
    for name, value in (("SMALL", (3, 6)), ("QUERIES", 2), ("EXACT_QUERIES", 1), ("VERIFIED", 1)):
        monkeypatch.setattr(localization, name, value)
    for module in (stages, localization.verification):
        monkeypatch.setattr(module, "OBBS", 6)
    monkeypatch.setattr(localization, "REAL", tmp_path)  # no photographs: views of the campus
    monkeypatch.setattr(kernels, "seconds", lambda: (4.0, 0.5))
    monkeypatch.setattr(sys, "argv", ["localization", "--small", "--json", str(tmp_path / "figures.json")])
    localization.main()
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert {
        "U_ms",
        "lists64_U",
        "lists64_growth_250_to_3000",
        "add_U",
        "bytes_per_image",
        "word_recall_at_1",
        "verify_speedup",
        "load_s",
        "map_sizes",
    } <= figures.keys()
    assert figures["map_sizes"] == [3, 6]
    assert figures["lists64_growth_250_to_3000"] is None  # it was not measured
    assert figures["word_recall_at_1"] == 1  # so small a map is searched exactly
    assert all(figures[name] > 0 for name in ("U_ms", "lists64_U", "add_U", "verify_speedup", "load_s"))
    assert 6 * figures["bytes_per_image"] > 6 * 1200 * 36  # its descriptors and their ids at least
    printed = capsys.readouterr().out
    assert "campus views of 640 × 480" in printed
    assert "compiled kernels: 4.0 s in the first process that uses them, 0.50 s in the next" in printed


def test_growth_is_none_unless_both_sizes_were_measured():
    row = localization.Measured(250, 1, 2.0, 1.0, 0.1, 0.1, 0.2, 3.0, 0.9)
    checked = localization.verification.Verification(1, 64, 200, 2, 20, 60, 40, 5)
    last = localization.Measured(3000, 9, 3.0, 1.0, 0.1, 0.5, 0.9, 2.0, 0.8)
    figures = localization.figures(0.5, [row, last], checked)
    assert figures["lists64_growth_250_to_3000"] == pytest.approx(1.5)
    assert figures["add_U"] == pytest.approx(1.0)
    assert (figures["verify_speedup"], figures["verify_speedup_own_lists"]) == (64, 10)
    assert localization.figures(0.5, [last], checked)["lists64_growth_250_to_3000"] is None


def test_every_way_to_train_autoencoders_has_a_line_and_the_same_loss(monkeypatch, capsys):
    given = ["--k", "2", "--images", "2", "--epochs", "1", "--channels", "2", "--pixels", "1024", "--turns", "1"]
    monkeypatch.setattr(sys, "argv", ["autoencoders", *given, "--cores", "1"])
    autoencoders.main()
    lines = [line.split("|") for line in capsys.readouterr().out.splitlines() if line.startswith("| 1 |")]
    assert [line[2].strip() for line in lines] == [*autoencoders.WAYS]
    assert len({line[7] for line in lines}) == 1


def test_comparison_prints_rates_and_ratios(monkeypatch):
    monkeypatch.setattr(comparison, "HEIGHT", 202)
    monkeypatch.setattr(comparison, "WIDTH", 154)
    monkeypatch.setattr(comparison, "cpu_seconds", lambda work, repeat=1: (work(), 2.0)[1])
    said = []
    comparison.main(said.append)
    rows = [line.split(" | ") for line in said[0].splitlines() if line.startswith("| ")]
    assert [row[0].strip("| ").split(",")[0] for row in rows[1:5]] == [
        "Harris-Laplace",
        next(row[0].strip("| ") for row in rows if row[0].startswith("| SIFT")),
        "of it the pyramid",
        "nearest of 10 map images",
    ]
    assert all(row[4] == "1.00" for row in rows[1:5])  # each took as long as its baseline
    rates = {row[0].strip("| "): float(row[1].strip("| ")) for row in rows[-3:]}
    assert rates["nearest_distance"] == rates["the product alone"]
    assert rates["2048 × 2048 × 2048"] == pytest.approx(2048**3 / 1e9, abs=0.05)


def test_a_query_takes_every_stage(tmp_path):
    robot = query.Robot(tmp_path, 24, 202, 154, 1)
    watch = query.Watch()
    one = robot.ask(watch)
    two = robot.ask(watch, 2)
    assert [cells.shape for cells in (*one, *two)] == [(21, 16)] * 3
    assert len({cells.tobytes() for cells in (*one, *two)}) == 3
    stages_ = {
        "ORB",
        "OBBs: BING",
        "OBBs: YOLO",
        "words",
        "weak lists and strong list",
        "FD",
        "PC",
        "AD",
        "mask",
        "fusion",
        query.SUPPORT,
    }
    assert watch.seconds.keys() == stages_
    assert all(len(times) == 2 and min(map(min, times)) >= 0 for times in watch.seconds.values())
    stored = {folder.name for folder in (tmp_path / "store").iterdir()}
    assert {
        "features",
        "obbs",
        "words",
        "localization",
        "fd",
        "pc",
        "word_support",
        "ad",
        "autoencoder",
        "mask",
    } <= stored
    said = []
    query.remember(robot, 2, said.append)
    assert said[-1].startswith("| 2 | ")
    printed = query.table(watch, watch, 2, (0.5, 0.25), 0.125)
    own = sum(
        statistics.median([clock for clock, _ in times])
        for name, times in watch.seconds.items()
        if name != query.SUPPORT
    )
    assert f"| **one query** | {1000 * own:.1f} |" in printed
    assert f"| {query.SUPPORT} | " in printed
    assert "| decoding its file once | 500.0 | 250.0 | 250.0 | 2.00 |" in printed


def test_a_query_in_mode_best_takes_every_stage_and_finds_its_place_in_larger_maps(tmp_path, monkeypatch):
    found = []
    monkeypatch.setattr(compact, "localize", lambda *given: found.append(localize(*given)) or found[-1])
    said = compact.measure(config_for(walk(tmp_path / "data"), tmp_path / "store"), 2, [4])
    stages_of_it, larger = said.split("\n\n")[1:]
    rows = [line.split(" | ") for line in stages_of_it.splitlines()]
    assert [row[0].strip("| ") for row in rows[2:]] == [
        "decode",
        "ORB",
        "OBBs: templates",
        "words",
        "lists",
        "FD, with word support",
        "looks",
        "alignment",
        "CC, WC and MW",
        "EF",
        "**one query**",
    ]
    assert sum(float(row[1]) for row in rows[2:-1]) == pytest.approx(float(rows[-1][1]), abs=1)
    assert said.startswith("data: M = 12, 160 × 120, U = ")
    sizes = [line.strip("| ").split(" | ") for line in larger.splitlines()[2:]]
    assert [row[0] for row in sizes] == ["12", "48"]
    for row in sizes:
        *parts, together = map(float, row[1:])
        assert sum(parts) == pytest.approx(together, abs=0.03)  # medians of two are means
    small, large = found[:3], found[3:]  # the first of each loads the kernels
    assert [one.ranks.shape[1] for one in (*small, *large)] == [12] * 3 + [48] * 3
    assert [one.strong[0] for one in small] == [one.strong[0] for one in large]


def test_an_update_is_timed_with_and_without_learning_again(tmp_path, monkeypatch):
    photos = sorted((walk(tmp_path / "world", count=14) / "map").iterdir())
    grown = []
    plain = update.ChangeDetector.update

    def noted(detector, images, learn):
        plain(detector, images, learn=learn)
        grown.append((len(detector), detector.config.learned))

    monkeypatch.setattr(update.ChangeDetector, "update", noted)
    rows = [line.strip("| ").split(" | ") for line in update.lines(photos, 6, SETTINGS)]
    assert [row[:2] for row in rows] == [["6 + 8", "keeps what it learned"], ["6 + 8", "learns again"]]
    assert grown == [(14, 6), (14, 0)]
    assert all(float(row[2]) > 0 for row in rows)
