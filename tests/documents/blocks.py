"""Fenced code blocks of the pages, and the commands in them."""

import re
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
PATTERNS = ("README.md", "docs/*.md", "experiments/*/README.md", "fdslam/weights/*.md")
PAGES = sorted(page for pattern in PATTERNS for page in ROOT.glob(pattern))
FENCE = re.compile(r"^ *```([^\n`]*)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
RUNS, SAYS, READS = ("sh", "python"), ("text",), ("bibtex",)  # languages: run, printed, only read


@dataclass(frozen=True)
class Block:
    """One block, and what the page says that it prints."""

    language: str
    text: str
    printed: str | None  # the block of text right below; None: the page does not say


def blocks(page: Path) -> list[Block]:
    """Return the blocks of a page that are run, each with the output below it."""
    text = page.read_text(encoding="utf-8")
    found = list(FENCE.finditer(text))
    assert text.count("```") == 2 * len(found), f"{page}: a block that does not end"
    for one in found:
        assert one[1] in (*RUNS, *SAYS, *READS), f"{page}: {one[1]!r} is no language that a test knows"
    return [
        Block(one[1], one[2], after[2] if after and after[1] == "text" and adjacent(text, one, after) else None)
        for one, after in pairwise([*found, None])
        if one[1] in RUNS
    ]


def adjacent(text: str, one: re.Match, after: re.Match) -> bool:
    """Tell whether only an empty line is between two blocks."""
    return not text[one.end() : after.start()].strip()


def commands(block: str) -> list[str]:
    """Return the commands of a block without comments, variables filled in; one that reads a document has its lines."""
    lines, known, found = iter(block.replace("\\\n", " ").splitlines()), {}, []
    for line in lines:
        command = line
        if (document := re.search(r"<<'(\w+)'$", line)) is not None:
            for below in lines:
                command += f"\n{below}"
                if below == document[1]:
                    break
        elif (variable := re.fullmatch(r'(\w+)="?([^"]*)"?', line)) is not None:
            known[variable[1]] = variable[2]
            continue
        else:
            command = " ".join(re.sub(r"\s#\s.*", "", line).split())
            command = re.sub(r"\$(\w+)", lambda name: known[name[1]], command)
        if command:
            found.append(command)
    return found
