"""The page of a run, read by a parser of HTML: its tables, its data and that it asks for nothing else."""

import hashlib
import json
import re
from base64 import b64decode, b64encode
from dataclasses import asdict, replace
from html.parser import HTMLParser
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from fdslam.boxes import Candidate
from fdslam.config import Report
from fdslam.errors import InputError
from fdslam.fusion import percentiles
from fdslam.provenance import Stopwatch, provenance
from fdslam.report.data import table_json
from fdslam.report.page import write_page
from fdslam.report.page.gallery import by_turns, gallery
from fdslam.report.page.images import COLOURS, LEVELS, image_key
from fdslam.report.page.render import STATIC, render
from fdslam.report.page.svg import INK, panel
from fdslam.report.page.why import disagreement
from fdslam.report.pictures import rank_queries
from fdslam.sessions import joined

VOID = {"meta", "link", "img", "input", "br"}


class Parsed(HTMLParser):
    """The elements of a page: tag, attributes and the text inside."""

    def __init__(self, text):
        super().__init__()
        self.all, self._open, self.declared = [], [], 0
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        entry = {"tag": tag, "text": "", **dict(attrs)}
        self.all.append(entry)
        if tag not in VOID:
            self._open.append(entry)

    def handle_startendtag(self, tag, attrs):
        self.all.append({"tag": tag, "text": "", **dict(attrs)})

    def handle_endtag(self, tag):
        assert self._open.pop()["tag"] == tag  # all is nested as it should be

    def handle_data(self, data):
        for entry in self._open:
            entry["text"] += data

    def every(self, tag):
        return [entry for entry in self.all if entry["tag"] == tag]

    def with_id(self, name):
        [entry] = [entry for entry in self.all if entry.get("id") == name]
        return entry

    def tables(self):
        """Per table its rows, each a list of texts."""
        found = []
        for entry in self.all:
            if entry["tag"] == "table":
                found.append([])
            elif entry["tag"] == "tr":
                found[-1].append([])
            elif entry["tag"] in ("th", "td"):
                found[-1][-1].append(" ".join(entry["text"].split()))
        return found


def written(outcome, config, tmp_path, **options):
    run = provenance(asdict(config), Stopwatch(), 1)
    write_page(outcome, config, tmp_path / "report.html", run, **options)
    return (tmp_path / "report.html").read_text(encoding="utf-8")


def data_of(page):
    return json.loads(page.with_id("data")["text"])


@pytest.fixture(scope="module")
def page(made, tmp_path_factory):
    config, outcome, _ = made
    return Parsed(written(outcome, config, tmp_path_factory.mktemp("page")))


def test_every_number_of_the_table_stands_in_it(made, page):
    config, outcome, _ = made
    pooled, within, *_ = page.tables()
    for entry in table_json(outcome, config, 0)["rows"]:
        for table, pool in ((pooled, "pooled"), (within, "per_query")):
            [row] = [row for row in table if row[0] == entry["method"]]
            figures = [*entry[pool].values(), *(entry[name] for name in ("auroc", "lc_auroc", "ap", "f1_max"))]
            for cell, figure, digits in zip(row[1:], figures, [1] * 4 + [3] * 4, strict=False):
                value, low, high = (f"{figure[name]:.{digits}f}" for name in ("value", "low", "high"))
                assert cell == f"{value} ({low}–{high})"
            leads = [entry["solo_leader"], entry["co_leader"]]
            assert row[9:] == ["–" if lead is None else f"{lead:.1f}" for lead in leads]
    flat = [row for table in page.tables() for row in table]
    for n, figure in outcome.recall.items():
        assert [str(n), f"{figure.value:.1f} ({figure.low:.1f}–{figure.high:.1f})"] in flat
    assert ["epochs", "2"] in flat
    assert ["k", "2 (not as the mode says)"] in flat


def test_names_are_text_wherever_they_stand(made, tmp_path):
    config, outcome, _ = made
    name = '</script><script>alert(1)</script><img src=x onerror=alert(2)> "q" \udcff'
    frames = tuple(replace(frame, name=f"{name}{i}") for i, frame in enumerate(outcome.dataset.query))
    hostile = replace(outcome, dataset=replace(outcome.dataset, name=name, query=frames, map=frames))
    parsed = Parsed(written(hostile, config, tmp_path))
    assert [script.get("type", "") for script in parsed.every("script")] == ["application/json", ""]
    assert parsed.every("img") == []
    assert [one["name"] for one in data_of(parsed)["queries"]] == [frame.name for frame in frames]
    assert parsed.every("h1")[0]["text"].startswith(name[:-1])
    assert not [key for entry in parsed.all for key in entry if key.startswith("on")]


def test_it_asks_for_nothing_and_runs_nothing_but_its_script(page):
    asked = [entry[key] for entry in page.all for key in ("src", "href", "xlink:href", "action") if key in entry]
    assert len(asked) > 10
    assert all(address.startswith(("#", "data:,")) for address in asked)
    assert "url(" not in page.every("style")[0]["text"]
    [policy] = [meta["content"] for meta in page.every("meta") if "http-equiv" in meta]
    script = page.every("script")[-1]["text"]
    allowed = b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert policy.startswith("default-src 'none'; img-src data:;")
    assert f"script-src 'sha256-{allowed}';" in policy


def test_figures_are_told_in_words_and_take_the_colour_of_the_text(made, page):
    _, outcome, _ = made
    figures = page.every("svg")
    assert [figure["role"] for figure in figures] == ["img"] * 2  # curve, recall; nothing was timed
    assert f"FD: {outcome.rows[0].pooled[5].value:.1f} % at X = 5 %" in figures[0]["aria-label"]
    assert f"@1: {outcome.recall[1].value:.1f} %" in figures[1]["aria-label"]
    drawn = panel(lambda axes: axes.plot([1, 2], label="<b>$a$"), '"a" <b>')
    assert INK not in drawn
    assert "currentColor" in drawn
    assert "&lt;b&gt;$a$</text>" in drawn
    assert Parsed(drawn).every("svg")[0]["aria-label"] == '"a" <b>'


def decoded(address):
    kind, _, held = address.partition(";base64,")
    return Image.open(BytesIO(b64decode(held)), formats=[kind.removeprefix("data:image/")])


def test_heat_maps_are_the_places_of_the_cells(made, page):
    config, outcome, _ = made
    data = data_of(page)
    assert data["methods"] == config.mix.rows
    assert COLOURS in ("inferno", "cividis")  # perceptually uniform and safe for the colour-blind
    for i, method in enumerate(data["methods"]):
        places = percentiles(outcome.maps[method])
        for one in data["queries"]:
            mine = places[one["id"] - 1]
            assert np.array_equal(np.array(decoded(one["heat"][i])), np.minimum(mine * LEVELS, LEVELS - 1).astype(int))
            alone = percentiles([mine])[0]
            assert np.array_equal(
                np.array(decoded(one["within"][i])), np.minimum(alone * LEVELS, LEVELS - 1).astype(int)
            )
            assert one["grid"] == list(reversed(mine.shape))


def test_a_query_is_told_as_it_is(made, page):
    _, outcome, _ = made
    data, known = data_of(page), outcome.dataset
    assert [one["id"] for one in data["queries"]] == [1, 2, 3, 4, 5, 6]
    for query, one in enumerate(data["queries"]):
        found, hypotheses = outcome.localizations[query], outcome.hypotheses[query]
        assert one["name"] == known.query[query].name
        assert decoded(data["images"][one["image"]]).size == (known.query[query].width, known.query[query].height)
        assert {source: box["count"] for source, box in one["obbs"].items()} == {"B": 4, "J": 15}
        assert one["obbs"]["B"]["path"].startswith("M0 0H80V60H0Z")
        assert [len(box["path"].split("Z")) - 1 for box in one["obbs"].values()] == [4, 15]
        for place, (m, told) in enumerate(zip(hypotheses, one["hypotheses"], strict=True)):
            assert told["name"] == known.map[m].name
            assert told["right"] == (m in known.relevant[query])
            assert told["relevance"] == pytest.approx(sum(1 / ranks[m] for ranks in found.ranks), abs=1e-4)
            assert told["image"] == image_key(known.map[m], 480 if place == 0 else 160)
        far = [min(ranks[m] for m in hypotheses) for ranks in found.ranks]
        assert [told["disagreement"] for told in one["why"]] == sorted(far, reverse=True)[:8]
        for told in one["why"]:
            [j] = np.flatnonzero((found.boxes.xyxy == np.float32(told["box"])).all(axis=1))
            assert told["ranks"] == [found.ranks[j][m] for m in hypotheses]
            assert told["source"] == found.boxes.source[j]
            first = int(np.argmin(found.ranks[j]))
            assert told["first"] == known.map[first].name
            assert told["ties"] == sum(found.ranks[j] == found.ranks[j][first]) - 1
    grades = [box["grades"] for one in data["queries"] for box in one["truth"]]
    assert grades == [{row.method: row.grades[i] for row in outcome.rows} for i in range(2)]


def test_disagreement_is_pooled_as_fd_pools():
    ranks = np.array([[3, 1, 8], [5, 5, 2]])
    for pooling, expected in {"min": [1, 2], "max": [8, 5], "mean": [4, 4], "median": [3, 5]}.items():
        assert disagreement(ranks, pooling).tolist() == expected
    assert disagreement(ranks[:, :0], "min").tolist() == [0, 0]


def test_the_worst_and_the_best_come_first_where_room_is_short(made):
    config, outcome, _ = made
    assert by_turns([0.5, 0.1, 0.9, 0.3, 0.7], 5) == [1, 2, 3, 4, 0]
    assert by_turns([], 3) == [0, 1, 2]
    best_first = rank_queries(outcome, percentiles(outcome.maps["FD+PC"]))
    turns = [best_first[i] for i in (-1, 0, -2, 1, -3, 2)]
    whole = gallery(outcome, config, 10**7)
    assert len(whole["queries"]) == 6
    size = len(json.dumps(whole))
    counts = set()
    for room in range(0, size, size // 8):
        found = gallery(outcome, config, room)
        counts.add(len(found["queries"]))
        assert sorted(turns[: len(found["queries"])]) == [one["id"] - 1 for one in found["queries"]]
        named = {name for one in found["queries"] for name in (one["image"], *(h["image"] for h in one["hypotheses"]))}
        assert set(found["images"]) == named
        assert len(json.dumps([found["queries"], found["images"]], separators=(",", ":"))) <= room or not counts - {0}
    assert len(counts) > 3


def test_the_page_is_as_large_as_it_may_be(made, tmp_path):
    config, outcome, _ = made
    limited = replace(config, report=Report(pictures=0, megabytes=0.2))
    text = written(outcome, limited, tmp_path)
    shown = len(data_of(Parsed(text))["queries"])
    assert 0 < shown < 6
    assert 150_000 < len(text.encode()) <= 200_000
    assert f"{shown} of 6 queries are in this page: of the last method the worst and the best" in " ".join(text.split())
    assert "report.megabytes" in text
    nothing = written(outcome, replace(config, report=Report(megabytes=0.1)), tmp_path)
    assert "0 of 6 queries" in nothing


def test_masks_are_shown(made, tmp_path):
    config, outcome, _ = made
    masks = tuple(np.arange(192).reshape(12, 16) % (5 + i) == 0 for i in range(6))
    data = data_of(Parsed(written(replace(outcome, masks=masks), config, tmp_path)))
    for mask, one in zip(masks, data["queries"], strict=True):
        assert np.array_equal(np.array(decoded(one["mask"]).convert("RGBA"))[..., 3] == 255, mask)


def test_photos_without_any_truth(made, tmp_path):
    config, outcome, _ = made
    bare = replace(outcome.dataset, boxes=None, relevant=None)
    recall = dict.fromkeys(outcome.recall)
    mine = replace(outcome, dataset=bare, rows=(), leaders={}, recall=recall, kept={})
    parsed = Parsed(written(mine, config, tmp_path, title="My <photos>"))
    data = data_of(parsed)
    assert parsed.every("h1")[0]["text"] == "My <photos>"
    assert [one["id"] for one in data["queries"]] == [1, 2, 3, 4, 5, 6]
    assert all(one["truth"] is None and "score" not in one for one in data["queries"])
    assert all(told["right"] is None for one in data["queries"] for told in one["hypotheses"])
    assert "boxes" not in data["queries"][0]
    ids = {one.get("id") for one in parsed.every("section")}
    assert ids == {"gallery", "costs", "origin"}  # nothing is said of what nothing is known of
    assert {one["href"] for one in parsed.every("a")} >= {"#gallery"}
    assert not {one["href"] for one in parsed.every("a")} & {"#accuracy", "#localisation"}
    assert parsed.every("svg") == []


def test_candidate_boxes_are_those_that_are_given(made, tmp_path):
    config, outcome, _ = made
    found = [tuple(Candidate(np.array([q, 2, 30.4, 40], np.float32), 1.0) for _ in range(q)) for q in range(6)]
    data = data_of(Parsed(written(outcome, config, tmp_path, candidates=found)))
    assert [one["boxes"] for one in data["queries"]] == [[[q, 2, 30, 40]] * q for q in range(6)]


def test_a_map_image_that_is_gone_leaves_a_blank(made, tmp_path):
    config, outcome, _ = made
    gone = tuple(replace(frame, path=tmp_path / frame.path.name) for frame in outcome.dataset.map)
    mine = replace(outcome, dataset=replace(outcome.dataset, map=gone))
    data = data_of(Parsed(written(mine, config, tmp_path)))
    for query in data["queries"]:
        own, first = (
            np.array(decoded(data["images"][key])) for key in (query["image"], query["hypotheses"][0]["image"])
        )
        assert own.std() > 20  # a picture full of corners
        assert np.median(first) == 128
    lost = replace(mine.dataset.query[0], path=tmp_path / "no.png")
    with pytest.raises(InputError, match="no such image"):
        written(replace(mine, dataset=replace(mine.dataset, query=(lost, *mine.dataset.query[1:]))), config, tmp_path)


def test_several_pairs_of_sessions(made, tmp_path):
    config, outcome, _ = made
    first, second = (replace(outcome.dataset, pair=(name, "SU")) for name in ("AU", "WI"))
    both = replace(
        outcome,
        dataset=joined([first, second]),
        localizations=outcome.localizations * 2,
        hypotheses=outcome.hypotheses + tuple(one + 6 for one in outcome.hypotheses),
        maps={name: outcome.maps[name] * 2 for name in config.mix.rows},
        rows=tuple(replace(row, grades=np.tile(row.grades, 2)) for row in outcome.rows),
        pairs=(replace(outcome, dataset=first), replace(outcome, dataset=second)),
    )
    parsed = Parsed(written(both, config, tmp_path))
    data = data_of(parsed)
    assert [one["pair"] for one in data["queries"]] == ["AU/SU"] * 6 + ["WI/SU"] * 6
    for left, right in zip(data["queries"][:6], data["queries"][6:], strict=True):
        assert left["why"] == right["why"]
        assert left["hypotheses"] == right["hypotheses"]
        assert left["truth"] == right["truth"]
    assert len(data["images"]) == len(data_of(Parsed(written(outcome, config, tmp_path)))["images"])  # embedded once
    assert "By pair of sessions" in [entry["text"] for entry in parsed.every("summary")]
    assert any(row[0] == "WI/SU" for table in parsed.tables() for row in table)
    bare = replace(both, pairs=(replace(outcome, dataset=replace(first, boxes=None)), *both.pairs))
    assert [one["pair"] for one in gallery(bare, config, 10**7)["queries"]] == ["AU/SU"] * 6 + ["WI/SU"] * 6


def test_colours_can_be_read_in_both_looks():
    """WCAG's contrast of text, 4.5, and of lines that mean something, 3."""
    text = (STATIC / "report.css").read_text(encoding="utf-8")
    looks = re.findall(r"--page: [^}]*", text)
    assert len(looks) == 3

    def light(colour):
        parts = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])
        return np.where(parts <= 0.03928, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722]

    def contrast(one, other):
        low, high = sorted((light(one), light(other)))
        return (high + 0.05) / (low + 0.05)

    for look in looks:
        colours = dict(re.findall(r"--(\w+): (#\w{6})", look))
        for ground in (colours["page"], colours["raised"]):
            assert min(contrast(colours[name], ground) for name in ("ink", "soft", "link")) >= 4.5
            assert contrast(colours["mark"], ground) >= 3
    assert looks[1].split("}")[0].split() == looks[2].split()  # asked for by the system or by the button


def test_a_page_names_all_that_its_template_wants():
    with pytest.raises(Exception, match="undefined"):
        render("run.html.j2", ())
