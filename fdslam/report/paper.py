"""The paper's Table I beside ours, with what differs (Sugimoto, Yamaguchi, Tanaka)."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

from fdslam.config import Config
from fdslam.modes import deviations
from fdslam.pipeline import Outcome

PAIRS = 12  # ordered pairs of four sessions
BEST_LIBRARY = {"J", "B", "BING", "YOLO"}  # the paper's


@cache
def published() -> dict[str, Any]:
    """Return the paper's table: "X" [4] percents, and "rows" from a method to [4] percent of the objects found."""
    found: dict[str, Any] = json.loads(Path(__file__).with_name("paper.json").read_text(encoding="utf-8"))
    return found


def differences(method: str, outcome: Outcome, config: Config) -> list[str]:
    """Return what is not as in the paper for a method, as far as it bears on its figures."""
    found = []
    if config.dataset.kind != "nclt":
        found.append("other images")
    if len(outcome.pairs) != PAIRS:
        found.append(f"{max(len(outcome.pairs), 1)} of {PAIRS} pairs of sessions")
    found.append("other annotations")  # the paper's were never published
    library = set(config.obb.library.split("+"))
    if library != BEST_LIBRARY:
        by = "" if "FD" in method.split("+") else "localised by "
        found.append(f"{by}OBBs {config.obb.library}")
    if "YOLO" in library and not config.obb.yolo.weights:
        found.append("detector of our own")
    if config.mask.source != "deeplabv3plus":
        found.append("no mask" if config.mask.source == "none" else f"mask {config.mask.source}")
    if "AD" in method.split("+"):
        found.append("AE of our own design")
    parts = {*method.lower().split("+"), "bow", "evaluation", *(["mix"] if "+" in method else [])}
    return found + [f"{key}={value}" for key, value in deviations(config).items() if key.split(".")[0] in parts]


def beside_paper(outcome: Outcome, config: Config) -> list[list[str]]:
    """Return head and one line per row of Table I that was run: the paper's figures, ours, and what differs."""
    percents = published()["X"]
    shown = " / ".join(map(str, percents))
    lines = [["method", f"paper, X = {shown} %", f"here, X = {shown} %", "what differs"]]
    for row in outcome.rows:
        if row.method not in published()["rows"]:
            continue
        theirs = " / ".join(f"{value:.1f}" for value in published()["rows"][row.method])
        ours = [row.pooled.get(x) for x in percents]
        ours_shown = " / ".join("–" if figure is None else f"{figure.value:.1f}" for figure in ours)
        lines.append([row.method, theirs, ours_shown, "; ".join(differences(row.method, outcome, config))])
    return lines
