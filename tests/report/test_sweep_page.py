"""The page of a sweep: a line for each job and method with the way to the job's page, and names that stay text."""

import json
import os
import shutil

import pytest

from fdslam.report.sweep import read_jobs, short_table, write_sweep
from tests.report.test_page import Parsed

KEY, VALUES = "dataset.root", ("a</script><script>alert(1)</script>", '"b" $x$ <i>')


def figure(value):
    return {"value": value, "low": value - 1, "high": value + 1}


def job(folder, value, found):
    """Write what a sweep reads of a finished job; the second of its rows is a control."""
    folder.mkdir(parents=True)
    config = {"name": "x", "dataset": {"root": value}, "mix": {"rows": ["FD"]}}
    rows = [
        {
            "method": method,
            **{pool: {str(x): figure(found + x) for x in (5, 20)} for pool in ("pooled", "per_query")},
            **dict.fromkeys(("auroc", "lc_auroc", "ap", "f1_max"), figure(0.5)),
        }
        for method in ("FD", "random")
    ]
    table = {"dataset": "w", "localization": {"recall@1": figure(90.0)}, "rows": rows, "pairs": []}
    (folder / "run.json").write_text(json.dumps({"config": config}))
    (folder / "table.json").write_text(json.dumps(table))


@pytest.fixture
def swept(tmp_path):
    for number, value in enumerate(VALUES):
        job(tmp_path / str(number), value, 10.0 * number)
    (tmp_path / "0" / "report.html").write_text("x")
    (tmp_path / "2").mkdir()
    (tmp_path / "2" / "error.txt").write_text("fd.mean=<b>: no such mean\n")
    write_sweep(tmp_path)
    return tmp_path


def test_every_line_of_the_short_table_with_the_way_to_its_job(swept):
    page = Parsed((swept / "sweep.html").read_text(encoding="utf-8"))
    [table] = page.tables()
    grid = short_table(read_jobs(swept))
    assert len(grid) == 3
    assert table == [["job", *grid[0]], ["0", *grid[1]], ["1", *grid[2]]]
    assert [link["href"] for link in page.every("a") if "report" in link["href"]] == ["0/report.html"]
    assert page.every("li")[0]["text"] == "2: fd.mean=<b>: no such mean"
    assert [one["text"] for one in page.every("script")][:-1] == []
    assert page.every("i") == page.every("b") == []


def test_its_figures_are_told_in_words(swept):
    page = Parsed((swept / "sweep.html").read_text(encoding="utf-8"))
    figures = page.every("svg")
    assert [one["role"] for one in figures] == ["img", "img"]
    assert figures[0]["aria-label"].startswith(f"Accuracy, lc-AUROC and localisation recall over {KEY}")
    assert VALUES[1] in [one["text"] for one in page.every("text")]  # an axis' label, dollars and all


def test_it_is_sorted_in_a_browser(swept):
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        pytest.skip("no Chromium is installed (Debian's package: chromium)")
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(
            executable_path=chromium, args=["--disable-gpu", *(["--no-sandbox"] if os.geteuid() == 0 else [])]
        )
        page = browser.new_page(viewport={"width": 375, "height": 700})
        wrong = []
        page.on("console", lambda message: wrong.append(message.text))
        page.on("dialog", lambda dialog: (wrong.append(dialog.message), dialog.dismiss()))
        page.goto((swept / "sweep.html").as_uri())
        jobs = page.locator("tbody th")
        assert jobs.all_inner_texts() == ["0", "1"]
        page.get_by_role("columnheader", name="X = 5 %").get_by_role("button").click()
        assert jobs.all_inner_texts() == ["1", "0"]
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        jobs.nth(1).get_by_role("link").click()
        assert page.inner_text("body") == "x"
        browser.close()
    assert wrong == []
