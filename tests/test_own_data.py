"""docs/own_data.md, followed to the letter: its commands run in an empty folder and say what the page says they do.

Commands of fdslam run in this process, where torch is loaded once; all others in a shell.
"""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from fdslam import convert, run

PAGE = Path(__file__).parent.parent / "docs" / "own_data.md"
BLOCK = re.compile(r"^```sh\n(.*?)^```\n(?:\n```text\n(.*?)^```\n)?", re.MULTILINE | re.DOTALL)
MAINS = {"fdslam.run": run.main, "fdslam.convert": convert.main}


def commands(block):
    """Yield the commands of a block, each with the document that it reads from the lines below."""
    lines = iter(block.splitlines())
    for line in lines:
        command = [line]
        if (document := re.search(r"<<'(\w+)'$", line)) is not None:
            for below in lines:
                command.append(below)
                if below == document[1]:
                    break
        yield "\n".join(command)


def execute(command, monkeypatch, capsys):
    """Run one command; return what it prints and its exit status."""
    words = shlex.split(command) if "\n" not in command else []
    if words[:2] == ["python", "-m"]:
        monkeypatch.setattr(sys, "argv", words[2:])
        status = 0
        try:
            MAINS[words[2]]()
        except SystemExit as ended:
            status = ended.code
        captured = capsys.readouterr()
        errors = [line for line in captured.err.splitlines() if line.startswith("fdslam: ")]
        return captured.out.splitlines() + errors, status
    shell = f'python() {{ {shlex.quote(sys.executable)} "$@"; }}\n{command}'
    done = subprocess.run(
        ["bash", "-ec", shell], capture_output=True, text=True, check=False, env=os.environ | {"LC_ALL": "C"}
    )
    return done.stdout.splitlines() + done.stderr.splitlines(), done.returncode


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


@pytest.fixture
def empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_the_page_is_true(empty_folder, monkeypatch, capsys):
    blocks = BLOCK.findall(PAGE.read_text())
    assert len(blocks) == PAGE.read_text().count("```sh")
    assert sum(bool(text) for _, text in blocks) >= 12
    for block, text in blocks:
        printed, failed = [], 0
        for command in commands(block):
            lines, status = execute(command, monkeypatch, capsys)
            assert status == 0 or (status == 2 and lines[-1].startswith("fdslam: ")), (command, lines)
            failed += status != 0
            printed += lines
        said = text.splitlines()
        assert failed == sum(line.startswith("fdslam: ") for line in said), (block, printed)
        assert agree(said, printed), (block, said, printed)


def test_the_page_is_linked():
    assert "docs/own_data.md" in (PAGE.parent.parent / "README.md").read_text()
