"""Every code block of the README and the pages runs, and what is not run is named with its reason and at least read.

docs/own_data.md is followed to the letter, in an empty folder; the runs of all other pages are made small. What a page
prints below a command is compared with what the command prints.
"""

import re
import shutil
import tomllib
from glob import glob

import pytest

from experiments.table1.campus_as_nclt import write_campus
from fdslam.config import Campus
from fdslam.obb.bing import OWN
from fdslam.store import Store
from tests.data.worlds import small_world
from tests.documents.blocks import PAGES, ROOT, blocks, commands
from tests.documents.execute import PATH, SIZES, execute, small, understood
from tests.documents.only_read import ONLY_READ

TO_THE_LETTER = ROOT / "docs" / "own_data.md"
NOT_RUN = {command for of_a_kind in ONLY_READ.values() for command in of_a_kind}
WITH_BLOCKS = [page for page in PAGES if blocks(page)]
WEIGHTS = ROOT / "fdslam" / "weights"
# What stands for the reader's own, and what is taken for it here.
HERE = {"FOLDER/ObjNessB2W8HSV": str(OWN), "campus_as_nclt DIR": "campus_as_nclt campus_as_nclt"}
BEFORE = {
    "outputs/table1/*": "python -m fdslam.run +experiment=table1 dataset=folder dataset.root=DIR"
}  # what is looked at
FOLDERS = {"nclt.md": "nclt"}  # DIR of a page; of all others it is a data set in the folder layout


def is_figure(line):
    """Tell a row of the table: its digits follow the versions of the libraries."""
    return re.search(r"\(\d+–\d+\)", line) is not None


def alike(line, printed):
    if is_figure(line):
        return is_figure(printed) and line[:14] == printed[:14]
    if line.startswith("localisation recall %"):
        return printed.startswith("localisation recall %")
    return re.fullmatch(re.escape(line).replace("…", ".*"), printed) is not None


def agree(said, printed):
    """Tell whether the lines of the page are those printed, in order; a line … stands for any number of them."""
    if not said:
        return not printed
    if said[0] == "…":
        return any(agree(said[1:], printed[i:]) for i in range(len(printed) + 1))
    return bool(printed) and alike(said[0], printed[0]) and agree(said[1:], printed[1:])


@pytest.fixture(scope="module")
def done():
    """The commands that ran in the workplace."""
    return set()


@pytest.fixture(scope="module")
def workplace(tmp_path_factory):
    """A folder with what the pages speak of: a data set, NCLT, and models under their names."""
    folder = tmp_path_factory.mktemp("workplace")
    small_world(folder / "world")
    write_campus(folder / "nclt", Campus(**SIZES, all_pairs=True), Store(folder / "store"))
    for theirs, ours in (("map", "before"), ("query", "after")):
        (folder / "photos" / ours).mkdir(parents=True)
        for i, image in enumerate(sorted((folder / "world" / theirs).iterdir())):
            shutil.copy(image, folder / "photos" / ours / f"{i:04d}.png")
    shutil.copy(WEIGHTS / "yolo_campus.onnx", folder / "yolox_nano.onnx")
    shutil.copy(WEIGHTS / "deeplabv3plus_campus.onnx", folder / "deeplabv3plus.onnx")
    return folder


def prepared(command, page, folder):
    """Return a command of a page as it is run here."""
    for theirs, ours in HERE.items():
        command = command.replace(theirs, ours)
    return small(re.sub(r"\bDIR\b", FOLDERS.get(page.name, "world"), command), folder / "store")


def as_script(block):
    """Return a block of Python as a command."""
    return f"python - <<'END'\n{block.text}END"


def read(command, monkeypatch):
    """Check a command that is not run."""
    if command.startswith("make "):
        target = command.split()[1]
        assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), re.MULTILINE), command
    elif command.startswith("pip "):
        extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
        assert set(re.search(r"\[(.*)\]", command)[1].split(",")) <= extras.keys()
        assert (ROOT / "constraints.txt").is_file()
    elif command.startswith("tensorboard "):
        assert shutil.which("tensorboard", path=PATH)
    else:
        understood(command, monkeypatch)


@pytest.mark.parametrize("page", WITH_BLOCKS, ids=lambda page: str(page.relative_to(ROOT)))
def test_a_page_is_true(page, workplace, done, monkeypatch, capsys, tmp_path):
    literally = page == TO_THE_LETTER
    monkeypatch.chdir(tmp_path if literally else workplace)
    for block in blocks(page):
        printed, failed = [], 0
        for command in commands(block.text) if block.language == "sh" else [as_script(block)]:
            if command in NOT_RUN:
                read(command, monkeypatch)
                continue
            for pattern, before in BEFORE.items():
                if pattern in command and not glob(pattern):
                    execute(prepared(before, page, workplace), monkeypatch, capsys)
            asked = command if literally else prepared(command, page, workplace)
            if asked in done and block.printed is None:
                continue  # another page has it too
            lines, status = execute(asked, monkeypatch, capsys)
            done |= set() if literally else {asked}
            assert status == 0 or (status == 2 and lines[-1].startswith("fdslam: ")), (command, lines)
            failed += status != 0
            printed += lines
        said = (block.printed or "").splitlines()
        assert failed == sum(line.startswith("fdslam: ") for line in said), (block, printed)
        if block.printed is not None:
            assert agree(said, printed), (block, said, printed)


def masked(line):
    """Return a line without what differs between a small run and the default one."""
    line = re.sub(r"mode (\w+) but .*, OBBs", r"mode \1, OBBs", line)
    return re.sub(r"[\d.]+", "0", re.sub(r"( |─)+", r"\1", line))


def test_the_demo_prints_what_the_readme_says(workplace, monkeypatch, capsys):
    monkeypatch.chdir(workplace)
    (command,) = re.findall(r"^demo:.*\n\t\$\(BIN\)/(python .*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"`make demo` runs `{command}`" in readme
    printed, _ = execute(small(command, workplace / "store"), monkeypatch, capsys)
    (said,) = re.findall(r"^```text\n(campus .*?)^```$", readme, re.MULTILINE | re.DOTALL)
    assert [masked(line) for line in said.splitlines()] == [masked(line) for line in printed[:-2]]
    assert printed[-1].split(" s, ")[1].startswith("written to outputs/fd_ad_pc/")


def test_own_data_shows_what_is_printed():
    assert sum(block.printed is not None for block in blocks(TO_THE_LETTER)) >= 12


def test_what_is_only_read_stands_on_a_page():
    found = {command for page in PAGES for block in blocks(page) for command in commands(block.text)}
    assert found >= NOT_RUN, NOT_RUN - found
    assert sum(map(len, ONLY_READ.values())) == len(NOT_RUN)  # none is there twice, with two reasons


def test_the_pages_are_linked():
    """Every page is reached from the README, over one more page at most."""
    first = links(ROOT / "README.md")
    assert set(PAGES) - {ROOT / "README.md"} <= first | {two for one in first if one in PAGES for two in links(one)}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    for one in links(page):
        assert one.exists(), one


def links(page):
    """Return the files that a page links to."""
    found = re.findall(r"\]\(([^)#\s]+)(?:#[\w-]+)?\)", page.read_text(encoding="utf-8"))
    return {(page.parent / one).resolve() for one in found if not one.startswith("http")}
