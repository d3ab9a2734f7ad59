"""Draw the stages and what flows between them: python -m experiments.drawing.stages.

Names of functions, types, detectors and sources are read off the code, so the drawing cannot name what is not there.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from types import ModuleType

from matplotlib import rc_context
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

from fdslam.bow.orb import extract
from fdslam.data import load_datasets
from fdslam.detectors import registry
from fdslam.fusion import fuse
from fdslam.hypotheses import hypotheses
from fdslam.localization import localize
from fdslam.mapping import BowMap
from fdslam.mask import apply_masks
from fdslam.metrics import evaluate
from fdslam.obb import parse_library
from fdslam.proposals import Proposals
from fdslam.report import write_report
from fdslam.store import write_atomically
from fdslam.types import Boxes, Dataset, Features, Localization

PAPER, INK, FAINT = "#fbfaf6", "#1f2933", "#5b6773"  # its own paper, so that it reads on a dark page too
OFFLINE, ONLINE, AFTER = "#dbe9f4", "#fdebc8", "#dcefdc"
WIDE, HIGH, ACROSS, DOWN = 1.72, 1.02, 2.05, 1.55  # of a box, and from box to box, inches
LIBRARY = "J+B+BING+YOLO"


@dataclass(frozen=True)
class Box:
    """One stage."""

    column: float
    row: int
    title: str
    lines: tuple[str, ...]  # what it does or gives
    does: tuple[Callable | type | ModuleType, ...]  # what of the code it is
    colour: str


def _words(*names: str) -> str:
    return " ".join(names)


BOXES = {
    "map": Box(0, 0, "map session", ("images, in path order", f"→ {Dataset.__name__}"), (load_datasets,), OFFLINE),
    "seen": Box(1, 0, "look", ("ORB keypoints", f"→ {Features.__name__}"), (extract,), OFFLINE),
    "bow": Box(2, 0, "bag-of-words map", ("vocabulary, inverted file;", "no image is kept"), (BowMap,), OFFLINE),
    "kept": Box(4, 0, "kept beside it", ("PC: SIFTs, AD: autoencoders,", "CC: signs, EF: trees"), (), OFFLINE),
    "query": Box(0, 1, "live image", ("of another season", f"→ {Dataset.__name__}"), (load_datasets,), ONLINE),
    "words": Box(
        1,
        1,
        "look",
        (_words(*parse_library(LIBRARY)), f"→ {Boxes.__name__}, {Features.__name__}"),
        (Proposals, extract),
        ONLINE,
    ),
    "place": Box(2, 1, "localise", ("weak lists, strong list", f"→ {Localization.__name__}"), (localize,), ONLINE),
    "top": Box(3, 1, "hypotheses", ("the first Y of the strong list", "→ map ids"), (hypotheses,), ONLINE),
    "detect": Box(
        4,
        1,
        "detect",
        (_words(*list(registry.DETECTORS)[:3]), _words(*list(registry.DETECTORS)[3:]), "→ cells"),
        (registry,),
        ONLINE,
    ),
    "fuse": Box(4, 2, "fuse", ("by ranks over all cells", "→ cells"), (fuse,), AFTER),
    "mask": Box(3, 2, "mask", ("sky and ground are reset", "→ cells"), (apply_masks,), AFTER),
    "evaluate": Box(2, 2, "evaluate", ("beside four controls", "→ rows"), (evaluate,), AFTER),
    "report": Box(1, 2, "report", ("tables, curves, pictures",), (write_report,), AFTER),
}
ARROWS = (
    ("map", "seen"), ("seen", "bow"), ("query", "words"), ("words", "place"), ("place", "top"), ("top", "detect"),
    ("bow", "place"), ("kept", "detect"), ("detect", "fuse"), ("fuse", "mask"), ("mask", "evaluate"),
    ("evaluate", "report"), ("map", "kept"),
)  # fmt: skip
ROWS = ("offline, once a map", "online, each query", "over all queries")


def code(found: Callable | type | ModuleType) -> str:
    """Return where something stands in the package, as ``module.name``."""
    name = found.__name__ if isinstance(found, ModuleType) else f"{found.__module__}.{found.__qualname__}"
    return name.removeprefix("fdslam.")


def _corner(box: Box) -> tuple[float, float]:
    return 0.15 + ACROSS * box.column, 0.25 + DOWN * (2 - box.row)


def draw() -> bytes:
    """Return the drawing as SVG, text as text."""
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "fdslam", "font.family": "DejaVu Sans"}):
        figure = Figure(figsize=(0.3 + 4 * ACROSS + WIDE, 0.78 + 2 * DOWN + HIGH), facecolor=PAPER)
        FigureCanvasSVG(figure)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set(xlim=(0, figure.get_figwidth()), ylim=(0, figure.get_figheight()))
        axes.axis("off")
        for row, label in enumerate(ROWS):
            left = 0.15 if row < 2 else 0.15 + ACROSS
            above = 0.33 if row else 0.49  # the arrow over the first row lies between
            axes.text(left, above + DOWN * (2 - row) + HIGH, label, size=8.5, color=FAINT, style="italic")
        for box in BOXES.values():
            _box(axes, box)
        for one, other in ARROWS:
            _arrow(axes, BOXES[one], BOXES[other])
        svg = BytesIO()
        figure.savefig(svg, format="svg", facecolor=PAPER, metadata={"Date": None, "Creator": None})
    return svg.getvalue()


def _box(axes, box: Box) -> None:
    x, y = _corner(box)
    shape = FancyBboxPatch(
        (x, y), WIDE, HIGH, boxstyle="round,pad=0,rounding_size=0.08", facecolor=box.colour, edgecolor=FAINT
    )
    axes.add_patch(shape)
    axes.text(x + WIDE / 2, y + HIGH - 0.2, box.title, ha="center", va="center", size=10, weight="bold", color=INK)
    for i, line in enumerate(box.lines):
        axes.text(x + WIDE / 2, y + HIGH - 0.42 - 0.16 * i, line, ha="center", va="center", size=7.5, color=INK)
    for i, found in enumerate(reversed(box.does)):
        where = y + 0.11 + 0.15 * i
        axes.text(
            x + WIDE / 2, where, code(found), ha="center", va="center", size=6.8, family="DejaVu Sans Mono", color=FAINT
        )


def _arrow(axes, one: Box, other: Box) -> None:
    (x0, y0), (x1, y1) = _corner(one), _corner(other)
    if one.row == other.row and abs(one.column - other.column) > 1:  # over the boxes between them
        x0, x1, above = x0 + WIDE / 2, x1 + WIDE / 2, y0 + HIGH + 0.14
        axes.plot([x0, x0, x1], [y0 + HIGH, above, above], color=INK, linewidth=1)
        start, end = (x1, above), (x1, y1 + HIGH)
    elif one.row == other.row:
        right = x1 > x0
        start, end = (x0 + WIDE * right, y0 + HIGH / 2), (x1 + WIDE * (not right), y1 + HIGH / 2)
    else:
        start, end = (x0 + WIDE / 2, y0), (x1 + WIDE / 2, y1 + HIGH)
    axes.add_patch(FancyArrowPatch(start, end, arrowstyle="-|>", mutation_scale=11, color=INK, shrinkA=0, shrinkB=0))


def main() -> None:
    """Write the drawing."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("docs/stages.svg"))
    write_atomically(parser.parse_args().out, draw())


if __name__ == "__main__":
    main()
