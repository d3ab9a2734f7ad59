"""Tables and pictures of a small world: what they say is read back and compared with the outcome itself."""

import csv
import io
import json
from dataclasses import replace

import numpy as np
from PIL import Image
from scipy.stats import rankdata

from experiments.table1.compare import comparison
from fdslam.config import METHODS, Mask, Obb, Yolo
from fdslam.fusion import percentiles
from fdslam.provenance import Stopwatch
from fdslam.report import pictures, write_report
from fdslam.report.curves import draw_curves
from fdslam.report.data import table_csv, table_json
from fdslam.report.latex import table_latex
from fdslam.report.paper import beside_paper, differences
from fdslam.report.pictures import rank_queries
from fdslam.report.tables import table_markdown, table_text


def test_csv_json_and_markdown_say_what_was_found(made):
    config, outcome, _ = made
    table = table_json(outcome, config, 1.5)
    assert json.loads(json.dumps(table, allow_nan=False)) == table
    lines = list(csv.DictReader(io.StringIO(table_csv(outcome))))
    for row, entry in zip(outcome.rows, table["rows"], strict=True):
        mine = {(line["pool"], line["figure"]): line for line in lines if line["method"] == row.method}
        for x, figure in row.pooled.items():
            assert entry["pooled"][str(x)]["value"] == figure.value == float(mine["all", f"top-{x}"]["value"])
        for x, figure in row.per_query.items():
            assert entry["per_query"][str(x)]["high"] == figure.high == float(mine["query", f"top-{x}"]["high"])
        assert float(mine["all", "lc-AUROC"]["low"]) == row.lc_auroc.low
        assert f"| {row.method} | {row.pooled[5].value:.1f} (" in table_markdown(outcome, config)
        assert f"{row.pooled[20].value:.1f} (" in table_text(outcome, config)
    leaders = {line["method"]: line["value"] for line in lines if line["figure"] == "solo-leader"}
    assert leaders == {name: str(lead.solo) for name, lead in outcome.leaders.items()}


def test_the_pool_of_the_configuration_is_shown(made):
    config, outcome, _ = made
    within = replace(config, evaluation=replace(config.evaluation, pool="query"))
    row = outcome.rows[0]
    assert f"| FD | {row.per_query[5].value:.1f} (" in table_markdown(outcome, within)
    assert "within each query" in table_text(outcome, within)


def test_what_deviates_from_the_mode_is_said(made):
    config, outcome, _ = made
    assert "mode paper but ad.k=2, OBBs J+B" in table_text(outcome, config)
    other = replace(config, fd=replace(config.fd, pooling="max"))
    assert table_json(outcome, other, 0)["deviations"] == {"fd.pooling": "max", "ad.k": 2}


def test_figures_that_are_undefined_are_dashes_and_nulls(made):
    config, outcome, _ = made
    rows = tuple(replace(row, lc_auroc=None, pooled=dict.fromkeys(row.pooled)) for row in outcome.rows)
    nothing = replace(outcome, rows=rows, leaders={}, recall=dict.fromkeys(outcome.recall))
    assert table_json(nothing, config, 0)["rows"][0]["lc_auroc"] == {"value": None, "low": None, "high": None}
    assert "| FD | – | – | – | – |" in table_markdown(nothing, config)
    assert "no place ground truth" in table_text(nothing, config)
    assert "nothing is evaluated" in table_text(replace(outcome, rows=()), config)


def test_beside_the_paper(made):
    config, outcome, _ = made
    text = comparison([table_json(outcome, config, 0)])
    assert "| FD | 7.8 / 15.8 / 27.2 / 39.6 | " in text
    assert "| centre blob | – | " in text


def test_report_writes_pictures_that_show_the_query(made, tmp_path):
    config, outcome, _ = made
    write_report(outcome, config, tmp_path, Stopwatch())
    names = sorted(path.name for path in (tmp_path / "pictures").iterdir())
    assert names == ["best_01.png", "best_02.png", "worst_01.png", "worst_02.png"]
    for name in names:
        pixels = np.array(Image.open(tmp_path / "pictures" / name).convert("RGB"))
        assert pixels.shape[1] > 2 * pixels.shape[0]  # two rows of panels
        assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 500
    assert (tmp_path / "report.html").stat().st_size > 1e5
    assert "pictures" in json.loads((tmp_path / "run.json").read_text())["seconds"]


def test_every_method_s_panel_shows_that_method(made, tmp_path, monkeypatch):
    config, outcome, _ = made
    shown = {}
    monkeypatch.setattr(pictures, "draw_query", lambda _, heat, query: shown.setdefault(query, heat) and b"")
    pictures.draw_pictures(outcome, config, tmp_path)
    assert len(shown) == 4
    for query, heat in shown.items():
        assert list(heat) == config.mix.rows
        for row, places in heat.items():
            assert np.array_equal(places, percentiles(outcome.maps[row])[query])


def test_percentiles_are_ranks_over_the_pool():
    maps = [np.array([[3.0, 1.0]]), np.array([[2.0], [3.0]])]
    found = np.concatenate([m.ravel() for m in percentiles(maps)])
    assert np.allclose(found, (rankdata([3, 1, 2, 3]) - 0.5) / 4)


def test_queries_go_from_best_to_worst(made):
    _, outcome, _ = made
    shape = outcome.maps["FD"][0].shape
    right = [np.zeros(shape) for _ in range(6)]
    right[1][6:10, 4:8] = 1  # the change of query 1 stands out
    right[3][:] = 1
    right[3][6:10, 4:8] = 0  # that of query 3 is the only thing that does not
    ranked = rank_queries(outcome, right)
    assert ranked[0] == 1
    assert ranked[-1] == 3
    assert rank_queries(replace(outcome, dataset=replace(outcome.dataset, boxes=None)), right) == []


def test_the_paper_stands_beside_with_what_differs(made):
    config, outcome, _ = made
    grid = beside_paper(outcome, config)
    lines = {line[0]: line for line in grid[1:]}
    assert list(lines) == list(METHODS)
    assert lines["FD"][1] == "7.8 / 15.8 / 27.2 / 39.6"
    ours = next(row for row in outcome.rows if row.method == "AD").pooled
    assert lines["AD"][2] == " / ".join(f"{ours[x].value:.1f}" for x in (5, 10, 15, 20))
    assert lines["FD"][3] == "other images; 1 of 12 pairs of sessions; other annotations; OBBs J+B; no mask"
    assert "AE of our own design; ad.k=2" in lines["FD+AD"][3]
    assert "localised by OBBs J+B" in lines["PC"][3]
    assert "ad." not in lines["FD+PC"][3]
    same = replace(config, obb=Obb("YOLO+J+B+BING"))
    expected = ["other images", "1 of 12 pairs of sessions", "other annotations", "detector of our own", "no mask"]
    assert differences("FD", outcome, same) == expected
    real = replace(config, obb=Obb("YOLO+J+B+BING", Yolo(weights="real.onnx")), mask=Mask(source="deeplabv3plus"))
    assert differences("FD", outcome, real) == expected[:3]
    assert "| FD+AD+PC | 2.6 / 20.1 / 34.1 / 42.1 | " in table_markdown(outcome, config)


def test_latex_holds_every_row_and_escapes(made):
    config, outcome, _ = made
    text = table_latex(replace(outcome, dataset=replace(outcome.dataset, name="50%_a&b")), config)
    assert r"on 50\%\_a\&b;" in text
    for row in outcome.rows:
        assert f"\n{row.method} & {row.pooled[5].value:.1f} {{\\scriptsize (" in text
    assert "FD, the paper on NCLT & 7.8 & 15.8 & 27.2 & 39.6 & --" in text
    body = text[text.index("toprule") : text.index("bottomrule")]
    assert {line.count(" & ") for line in body.splitlines() if " & " in line} == {5}
    other = table_latex(outcome, replace(config, evaluation=replace(config.evaluation, X=[5, 20])))
    assert "the paper on NCLT" not in other


def test_curves_are_drawn_where_there_is_something_to_draw(made):
    config, outcome, _ = made
    assert draw_curves(outcome, config).startswith(b"\x89PNG")
    rows = tuple(replace(row, found_at=None) for row in outcome.rows)
    assert draw_curves(replace(outcome, rows=rows), config) is None
