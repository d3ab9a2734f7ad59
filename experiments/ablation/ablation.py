"""What each switch of mode tuned does to FD, and each rule to fusions: python -m experiments.ablation.ablation [DIR …]

One row for the paper's mode, each switch alone, all of them, and all but each, on every folder given (as
dataset=folder wants it) or, with none, on the campus; OBBs J+B+BING+YOLO, no mask.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from fdslam.config import METHODS, Ad, Bing, Bow, Campus, Config, Evaluation, Fd, Folder, Mix, Obb, Pc, Yolo
from fdslam.fusion import RULES
from fdslam.metrics import Row
from fdslam.modes import CONF
from fdslam.pipeline import run
from fdslam.progress import single_threaded
from fdslam.provenance import Stopwatch

Switches = dict[str, dict[str, Any]]
GROUPS: dict[str, Any] = {"bow": Bow, "fd": Fd, "pc": Pc, "ad": Ad, "mix": Mix, "evaluation": Evaluation}
ALONE: dict[str, Switches] = {
    "keypoints: fast_threshold=7, grid=16": {"bow": {"fast_threshold": 7, "grid": 16}},
    "bow.min_keypoints=10": {"bow": {"min_keypoints": 10}},
    "fd.mean=geometric": {"fd": {"mean": "geometric"}},
    "fd.weights=area": {"fd": {"weights": "area"}},
    "fd.support=1": {"fd": {"support": 1.0}},
}
NOT_USED: dict[str, Switches] = {
    "fd.gate=3": {"fd": {"gate": 3}},
    "bow.unretrieved=next": {"bow": {"unretrieved": "next"}},
}
FUSED = [method for method in METHODS if method != "FD+AD"]


def mode(name: str) -> Switches:
    """Return the switches of a mode."""
    found = OmegaConf.to_container(OmegaConf.load(CONF / "mode" / f"{name}.yaml"))
    assert isinstance(found, dict)
    return {str(group): dict(values) for group, values in found.items() if isinstance(values, dict)}


def merged(*parts: Switches) -> Switches:
    """Return switches with later ones over earlier ones."""
    groups = {group for part in parts for group in part}
    return {group: {key: value for part in parts for key, value in part.get(group, {}).items()} for group in groups}


def fd_variants() -> Iterator[tuple[str, Switches]]:
    """Yield the name and the switches of every row of FD."""
    paper, tuned = mode("paper"), mode("tuned")
    yield "mode=paper", paper
    for name, switch in (ALONE | NOT_USED).items():
        yield f"paper, {name}", merged(paper, switch)
    yield "mode=tuned", tuned
    plain = merged({"bow": {"fast_threshold": Bow().fast_threshold, "grid": Bow().grid}}, paper)
    for name, switch in ALONE.items():
        back = {group: {key: plain[group][key] for key in values} for group, values in switch.items()}
        yield f"tuned without {name}", merged(tuned, back)
    for name, switch in NOT_USED.items():
        yield f"tuned, {name}", merged(tuned, switch)


def fusion_variants() -> Iterator[tuple[str, Switches]]:
    """Yield the name and the switches of every set of fused rows."""
    yield "mode=paper, harmonic (b)", mode("paper")
    for rule in RULES:
        yield f"mode=tuned, {rule}", merged(mode("tuned"), {"mix": {"rule": rule}})


def config(data: Any, obb: Obb, switches: Switches, rows: list[str], store: str) -> Config:
    """Return the whole configuration of a row."""
    groups = {name: kind(**switches.get(name, {})) for name, kind in GROUPS.items() if name != "mix"}
    mix = Mix(rows=rows, **switches.get("mix", {}))
    return Config(name="ablation", dataset=data, obb=obb, mix=mix, store=store, workers=1, **groups)


def line(data: str, name: str, row: Row, kept: float) -> str:
    """Return one row of Markdown."""
    found = " / ".join(f"{figure.value:.1f}" for figure in row.pooled.values() if figure)
    at = row.pooled[max(row.pooled)]
    top = f"{at.low:.0f}–{at.high:.0f}" if at else "–"
    lc = row.lc_auroc
    area = f"{lc.value:.3f} ({lc.low:.3f}–{lc.high:.3f})" if lc else "–"
    return f"| {data} | {name} | {row.method} | {found} | {top} | {area} | {kept / 1000:.0f} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--yolo", default="", help="ONNX file of a detector; without it the shipped one")
    parser.add_argument("--bing", default="", help="BING filters; without them the shipped ones")
    parser.add_argument("--store", default="outputs/store")
    parser.add_argument("--part", choices=("fd", "fusion"), default="fd")
    parser.add_argument("--rows", nargs="*", choices=METHODS, help="of the fusions, instead of all but FD+AD")
    options = parser.parse_args()
    single_threaded()
    obb = Obb("J+B+BING+YOLO", yolo=Yolo(weights=options.yolo), bing=Bing(filters=options.bing))
    variants, rows = (fd_variants, ["FD"]) if options.part == "fd" else (fusion_variants, options.rows or FUSED)
    print("| data set | variant | rows | X = 5 / 10 / 15 / 20 % | at 20 % | lc-AUROC | KB / image |", flush=True)
    print("|---|---|---|---|---|---|---:|", flush=True)
    for data in [Folder(root=str(folder)) for folder in options.folders] or [Campus(kind="campus")]:
        controls = options.part == "fd"
        for name, switches in variants():
            outcome = run(config(data, obb, switches, rows, options.store), Stopwatch())
            for row in outcome.rows:
                if row.method in rows:
                    parts = row.method.split("+")
                    kept = outcome.kept["bag of words"] + sum(outcome.kept[part] for part in parts)
                    print(line(outcome.dataset.name, name, row, kept), flush=True)
                elif controls:
                    print(line(outcome.dataset.name, "control", row, 0.0), flush=True)
            controls = False


if __name__ == "__main__":
    main()
