"""How many objects the proposals of BING find: python -m experiments.obb_study.detection_rate [FOLDER ...]

The share of annotated objects that a box finds with IoU ≥ 0.5, against the number of boxes, on views of the embedded
world and on every folder given (as dataset=folder wants it). Beside BING with our filters and, where they are given,
the published ones: random boxes (mean of RUNS seeds) and the fixed templates.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from experiments.train.scenes import annotated_scenes, campus_scenes
from fdslam.config import Campus, Folder
from fdslam.data.folder import read_folder
from fdslam.obb.bing import load_filters, own_filters, proposals
from fdslam.obb.bing.training import FOUND, Scene
from fdslam.obb.overlap import first_found
from fdslam.obb.templates import TEMPLATES, template_boxes
from fdslam.progress import single_threaded
from fdslam.store import write_atomically
from fdslam.types import Image

MOST = 1000
AT = (1, 5, 10, 20, 50, 100, 200, 500, 1000)
RUNS = 10  # of random boxes
SHORTEST = 16  # pixels: of a random box, as of BING's smallest window
STYLES = {  # colour, and line or marker
    "BING, ours": ("C3", "-"),
    "BING, published, maxbgr": ("C0", "-"),
    "BING, published, hsv": ("C1", "--"),
    "BING, published, grey": ("C2", "--"),
    "BING, published, together": ("C4", ":"),
    "random boxes": ("0.5", "-"),
    "templates J+B": ("black", "s"),
    "all templates": ("black", "^"),
}
LIBRARIES = {"templates J+B": ("J", "B"), "all templates": tuple(TEMPLATES)}
Source = Callable[[Image, np.random.Generator], NDArray]  # an image -> boxes [n, 4] xyxy, best first
Curve = NDArray[np.float64]  # [MOST] share of the objects found among the first 1 … MOST boxes


def random_boxes(height: int, width: int, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return boxes of log-uniform sides (from SHORTEST to the image's), anywhere in it: [count, 4] xyxy."""
    whole = np.array([width, height])
    size = np.exp(rng.uniform(np.log(np.minimum(SHORTEST, whole)), np.log(whole), (count, 2)))
    corner = rng.uniform(0, 1, (count, 2)) * (whole - size)
    return np.concatenate([corner, corner + size], axis=1)


def rates(scenes: Sequence[Scene], source: Source, runs: int = 1) -> Curve:
    """Return the share of the scenes' objects found among the first n boxes, mean of ``runs`` seeds."""
    needed = [
        first_found(source(scene.image, np.random.default_rng([run, i])), scene.objects, FOUND)
        for run in range(runs)
        for i, scene in enumerate(scenes)
        if len(scene.objects)
    ]
    every = np.concatenate(needed)
    return np.searchsorted(np.sort(every), np.arange(1, MOST + 1), side="right") / len(every)


def sources(published: Path | None) -> Iterator[tuple[str, Source, int, int]]:
    """Yield the name of each source, the source, how many boxes it has, and over how many seeds to average."""
    ours = own_filters()
    yield "BING, ours", lambda image, _: proposals(image, ours, MOST)[0], MOST, 1
    if published:
        every = load_filters(published)
        for one in every:
            name = f"BING, published, {one.space}"
            yield name, lambda image, _, one=one: proposals(image, one, MOST)[0], MOST, 1
        yield "BING, published, together", lambda image, _: proposals(image, every, MOST)[0], MOST, 1
    yield "random boxes", lambda image, rng: random_boxes(*image.shape[:2], MOST, rng), MOST, RUNS
    for name, letters in LIBRARIES.items():
        count = sum(len(TEMPLATES[letter]) for letter in letters)

        def boxes(image: Image, _: np.random.Generator, letters: tuple[str, ...] = letters) -> NDArray:
            return np.concatenate([template_boxes(letter, *image.shape[:2]) for letter in letters])

        yield name, boxes, count, 1


def table(measured: dict[str, dict[str, tuple[Curve, int]]], objects: dict[str, int]) -> str:
    """Return a table a data set, Markdown; templates have one figure each, in the column that holds all of them."""
    lines = []
    for data, curves in measured.items():
        lines += [
            f"\n| {data}: {objects[data]} objects; n = | " + " | ".join(map(str, AT)) + " |\n|---|" + "---:|" * len(AT)
        ]
        for name, (curve, count) in curves.items():
            first = next(n for n in AT if n >= count)
            cells = [f"{100 * curve[n - 1]:.1f}" if count == MOST or n == first else "" for n in AT]
            named = name if count == MOST else f"{name} ({count})"
            lines.append(f"| {named} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def plot(measured: dict[str, dict[str, tuple[Curve, int]]], objects: dict[str, int]) -> bytes:
    """Return the curves as PNG, one panel a data set; the templates are points."""
    columns = min(len(measured), 2)
    rows = -(-len(measured) // columns)
    figure = Figure(figsize=(5 * columns, 3.6 * rows + 0.7), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    for panel, (data, curves) in zip(axes, measured.items(), strict=False):
        for name, (curve, count) in curves.items():
            if count == MOST:
                colour, line = STYLES[name]
                panel.plot(np.arange(1, MOST + 1), 100 * curve, line, color=colour, linewidth=1.5, label=name)
            else:
                panel.plot(count, 100 * curve[count - 1], STYLES[name][1], color="black", markersize=6, label=name)
        panel.set(xscale="log", xlim=(1, MOST), ylim=(0, 100), title=f"{data}, {objects[data]} objects")
        panel.grid(alpha=0.3)
    for panel in axes[len(measured) :]:
        panel.set_visible(False)
    for panel in axes[-columns:]:
        panel.set_xlabel("boxes an image")
    for panel in axes[::columns]:
        panel.set_ylabel("objects found, %")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=9)
    png = BytesIO()
    figure.savefig(png, format="png", metadata={"Software": None})
    return png.getvalue()


def main() -> None:
    """Measure; print the tables and write the plot."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--published", type=Path, metavar="DIR", help="folder with the published filters")
    parser.add_argument("--images", type=int, default=Campus().images, help="campus views")
    parser.add_argument("--seed", type=int, default=Campus().seed, help="which campus")
    parser.add_argument("--workers", type=int, default=0)
    parser.add_argument("--plot", type=Path, metavar="PNG")
    given = parser.parse_args()
    single_threaded()
    scenes = {"campus": list(campus_scenes([given.seed], given.images, given.workers))}
    scenes |= {folder.name: list(annotated_scenes([read_folder(folder, Folder())])) for folder in given.folders}
    objects = {name: sum(len(scene.objects) for scene in some) for name, some in scenes.items()}
    measured: dict[str, dict[str, tuple[Curve, int]]] = {
        data: {name: (rates(some, source, runs), count) for name, source, count, runs in sources(given.published)}
        for data, some in scenes.items()
    }
    print(f"% of the objects found (IoU ≥ {FOUND}) among the first n boxes\n{table(measured, objects)}")
    if given.plot:
        write_atomically(given.plot, plot(measured, objects))


if __name__ == "__main__":
    main()
