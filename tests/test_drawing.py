"""The drawing of the stages says what the code does: its names are those that a run uses, and the file is current."""

import ast
import re
from graphlib import TopologicalSorter

from experiments.drawing.stages import ARROWS, BOXES, code, draw
from fdslam.detectors import registry
from tests.documents.blocks import ROOT


def texts(svg):
    return re.findall(r"<text[^>]*>([^<]*)</text>", svg)


def used():
    """The names that are used, not only imported, in the modules that join the stages."""
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in (ROOT / "fdslam").glob("*.py")]
    return {node.id for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Name)}


def test_the_file_is_the_drawing():
    assert texts((ROOT / "docs" / "stages.svg").read_text(encoding="utf-8")) == texts(draw().decode())


def test_every_stage_is_one_that_a_run_goes_through():
    names = used()
    drawn = {"DETECTORS" if one is registry else code(one).split(".")[-1] for box in BOXES.values() for one in box.does}
    assert drawn <= names, drawn - names
    assert {"load_datasets", "BowMap", "hypotheses", "DETECTORS", "fuse", "apply_masks", "evaluate"} <= drawn


def test_every_detector_is_named():
    said = " ".join(texts(draw().decode())).split()
    assert set(registry.DETECTORS) <= set(said)


def test_the_arrows_lead_from_every_box_to_the_report():
    graph = {name: {one for one, other in ARROWS if other == name} for name in BOXES}
    order = list(TopologicalSorter(graph).static_order())
    assert set(order) == set(BOXES)
    assert {name for name in BOXES if name not in {one for one, _ in ARROWS}} == {"report"}
