"""The page of a run in a real browser, from disk, by hand and by keyboard. Skipped where no Chromium is installed."""

import os
import shutil
from dataclasses import replace

import numpy as np
import pytest

from fdslam.provenance import Stopwatch
from fdslam.report import write_report
from fdslam.report.pictures import percentiles, score_queries

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed (Debian's package: chromium)")
QUIET = ["--disable-gpu", "--disable-background-networking", "--disable-component-update", "--disable-sync"]
WIDE, NARROW = {"width": 1280, "height": 900}, {"width": 375, "height": 700}
METHODS = ["FD", "PC", "AD", "FD+AD+PC", "FD+AD", "FD+PC"]


@pytest.fixture(scope="module")
def report(made, tmp_path_factory):
    """The address of the page of a run with a mask."""
    config, outcome, _ = made
    folder = tmp_path_factory.mktemp("rün <i> #1")
    masks = tuple(np.arange(192).reshape(12, 16) < 32 for _ in outcome.dataset.query)
    write_report(replace(outcome, masks=masks), config, folder, Stopwatch())
    return (folder / "report.html").as_uri()


@pytest.fixture(scope="module")
def chromium():
    sync_playwright = pytest.importorskip("playwright.sync_api").sync_playwright
    alone = ["--no-sandbox"] if os.geteuid() == 0 else []  # root has no sandbox
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=[*QUIET, *alone])
        yield browser
        browser.close()


@pytest.fixture
def look(chromium, report):
    """Open the page in a look; in the end it must have had no complaint and asked for nothing but itself."""
    contexts, wrong, asked = [], [], []

    def opened(scheme="light", size=WIDE, script=True, address=""):
        context = chromium.new_context(
            color_scheme=scheme, viewport=size, java_script_enabled=script, reduced_motion="reduce"
        )
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(60_000)  # the machine may be shared
        page.on("console", lambda message: wrong.append(message.text))
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("requestfailed", lambda request: wrong.append(request.url))
        page.on("dialog", lambda dialog: (wrong.append(dialog.message), dialog.dismiss()))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(report + address)
        return page

    yield opened
    for context in contexts:
        context.close()
    assert wrong == []
    assert {address.split("#")[0] for address in asked if not address.startswith("data:")} == {report}


def names(page):
    return page.locator("#cards h3").all_text_contents()


def choice(page, label):
    return page.get_by_role("combobox", name=label, exact=True)


def fits(page):
    return page.evaluate("document.documentElement.scrollWidth <= innerWidth")


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("size", [WIDE, NARROW])
def test_every_look_fits_and_shows_the_images(look, scheme, size):
    page = look(scheme, size)
    assert fits(page)
    for card in page.locator(".card").all():  # they are filled when they come near the window
        card.scroll_into_view_if_needed()
        card.locator(".scene").wait_for()
    assert page.evaluate("[...document.images].every((image) => image.naturalWidth > 0 && image.hasAttribute('alt'))")
    columns = {round(card.bounding_box()["x"]) for card in page.locator(".card").all()}
    assert len(columns) == (2 if size == WIDE else 1)
    ground = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (ground == "rgb(255, 255, 255)") == (scheme == "light")
    page.get_by_role("button", name="Dark" if scheme == "light" else "Light").click()
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") != ground
    page.goto(f"{page.url.split('#')[0]}#query-2")
    page.locator("#why h1").wait_for()
    assert fits(page)
    assert page.evaluate("[...document.images].every((image) => image.hasAttribute('alt'))")


def test_names_are_shown_as_text(made, look):
    page = look()
    known = {frame.name for frame in made[1].dataset.query}
    assert set(names(page)) == known
    assert all("<script>" in name and '"' in name and "ö" in name for name in known)
    assert page.locator("#main script, #why script, h1 b").count() == 0


def test_methods_and_overlays_are_switched(look):
    page = look(address="#gallery")
    box = page.locator("#cards .scene").first
    box.wait_for()
    shown = set()
    for method in METHODS:
        choice(page, "method").select_option(label=method)
        heat = box.get_by_role("img", name=f"Likelihood of change by {method}", exact=True)
        shown.add(heat.get_attribute("src"))
        assert page.evaluate("(image) => image.decode().then(() => image.naturalWidth)", heat.element_handle()) == 16
    assert len(shown) >= 4
    page.get_by_label("opacity").fill("0.2")
    assert box.locator(".heat").evaluate("(image) => getComputedStyle(image).opacity") == "0.2"
    for label, part in {
        "heat map": ".heat",
        "mask": ".mask",
        "J": ".obb[data-source=J]",
        "B": ".obb[data-source=B]",
    }.items():
        was = box.locator(part).is_visible()
        page.get_by_role("checkbox", name=label, exact=True).click()
        assert box.locator(part).is_visible() != was
    assert "15 OBBs of J" in box.locator(".lines").get_attribute("aria-label")
    assert page.locator(".card .top").first.is_visible()
    page.get_by_label("top map image").click()
    assert not page.locator(".card .top").first.is_visible()


def test_sorted_and_filtered_as_the_run_found(made, look):
    config, outcome, _ = made
    page = look()
    frames = outcome.dataset.query
    for method in ("FD+PC", "PC", "AD"):
        choice(page, "method").select_option(label=method)
        scores = np.round(score_queries(outcome, percentiles(outcome.maps[method])), 4)
        worst = sorted(range(6), key=lambda query: (scores[query], query))
        choice(page, "order").select_option("worst first")
        assert names(page) == [frames[query].name for query in worst]
        choice(page, "order").select_option("best first")
        assert names(page) == [frames[q].name for q in sorted(range(6), key=lambda q: (-scores[q], q))]
    choice(page, "order").select_option("order of the path")
    row = next(row for row in outcome.rows if row.method == "AD")
    place = {1: 0, 3: 1}  # changed query -> its object
    for i, x in enumerate(sorted(config.evaluation.X)):
        choice(page, "found at X =").select_option(f"{x} %")
        found = [query for query, one in place.items() if row.grades[one] <= i]
        for option, expected in {
            "all objects found": found,
            "an object missed": [query for query in place if query not in found],
            "unchanged": [0, 2, 4, 5],
            "all": range(6),
        }.items():
            choice(page, "show").select_option(option)
            assert names(page) == [frames[query].name for query in expected]
            assert page.get_by_role("status").inner_text() == f"{len(expected)} of 6 queries shown"


def test_why_and_back_by_keyboard(made, look):
    outcome = made[1]
    page = look(address="#gallery")
    choice(page, "order").select_option("order of the path")
    links = page.locator("#cards h3 a")
    links.nth(1).focus()
    page.keyboard.press("Enter")
    page.get_by_role("heading", level=1, name=outcome.dataset.query[1].name).wait_for()
    assert page.url.endswith("#query-2")
    assert page.evaluate("document.activeElement.id") == "why"
    assert page.locator("#main").is_hidden()
    rows = page.locator("#why table tbody tr")
    far = sorted((int(ranks[outcome.hypotheses[1]].min()) for ranks in outcome.localizations[1].ranks), reverse=True)
    assert [row.locator("td").nth(2).inner_text() for row in rows.all()] == [str(value) for value in far[:8]]
    assert page.locator(".witness:visible").count() == 8
    rows.nth(2).get_by_role("button").press("Enter")
    assert page.locator(".witness:visible text").all_text_contents() == ["3"]
    assert page.locator(".strong li").count() == len(outcome.hypotheses[1])
    assert "right place" in page.locator(".strong li").first.inner_text()
    heats = page.locator(".heats .heat")
    assert heats.count() == 6
    before = heats.nth(1).get_attribute("src")
    choice(page, "Brightness is the place among").select_option("the cells of this query")
    assert heats.nth(1).get_attribute("src") != before
    page.locator("#why").focus()
    page.keyboard.press("ArrowRight")
    page.get_by_role("heading", level=1, name=outcome.dataset.query[2].name).wait_for()
    page.keyboard.press("ArrowLeft")
    page.get_by_role("heading", level=1, name=outcome.dataset.query[1].name).wait_for()
    page.keyboard.press("Escape")
    page.locator("#main").wait_for()
    assert page.locator("#why").is_hidden()
    assert page.evaluate("document.activeElement.textContent") == outcome.dataset.query[1].name
    page.go_forward()
    page.locator("#why h1").wait_for()
    page.go_back()
    page.locator("#main").wait_for()
    page.goto(f"{page.url.split('#')[0]}#query-99")
    assert page.get_by_role("alert").inner_text() == "This query is not in the page."


def test_the_first_stop_of_the_keyboard_leads_to_the_content(look):
    page = look()
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "Skip to the content"
    assert page.locator(".skip").bounding_box()["x"] >= 0
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "main"


def test_tables_are_sorted_by_their_heads(look):
    page = look()
    table = page.locator("#accuracy table").first
    head = table.get_by_role("columnheader", name="lc-AUROC")

    def values():
        return [float(text.split()[0]) for text in table.locator("tbody tr td:nth-child(7)").all_inner_texts()]

    head.get_by_role("button").click()
    assert head.get_attribute("aria-sort") == "descending"
    assert values() == sorted(values(), reverse=True)
    head.get_by_role("button").press("Enter")
    assert head.get_attribute("aria-sort") == "ascending"
    assert values() == sorted(values())
    table.get_by_role("columnheader", name="method").get_by_role("button").click()
    methods = table.locator("tbody th").all_inner_texts()
    assert methods == sorted(methods, key=str.lower)


def test_tables_and_curves_need_no_script(look):
    page = look(script=False)
    assert "needs JavaScript" in page.locator("#gallery").inner_text()
    assert page.locator("#accuracy table").first.is_visible()
    assert page.locator("#curves svg").is_visible()
    assert page.locator("#look").is_hidden()
