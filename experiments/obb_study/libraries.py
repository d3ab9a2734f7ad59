"""Put sweeps over the OBB library side by side, as Markdown and as a figure.

python -m experiments.obb_study.libraries SWEEP … --plot libraries.png

A SWEEP is the folder of ``python -m fdslam.run +experiment=obb_study``.
"""

from __future__ import annotations

import argparse
from io import BytesIO
from pathlib import Path

import matplotlib as mpl
import pyarrow.parquet
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fdslam.report.curves import COLOURS
from fdslam.store import write_atomically

RECALL, TOPS, AREA = ("recall@1", "recall@5", "recall@10"), ("top-5", "top-10", "top-15", "top-20"), "lc-AUROC"
MARKS = "osD^vP"
TEN_TEMPLATES = "+".join("ABCDEFGHIJ")
Figures = dict[str, tuple[float, float, float]]  # figure -> value, low, high


def shown(library: str) -> str:
    """Return a library's name, all ten templates as A…J."""
    return library.replace(TEN_TEMPLATES, "A…J")


def read(folder: Path) -> tuple[str, dict[str, Figures]]:
    """Return the data set of a sweep and, per library, FD's figures and the localisation's."""
    found: dict[str, Figures] = {}
    lines = pyarrow.parquet.read_table(folder / "sweep.parquet").to_pylist()
    for line in lines:
        ours = not line["pair"] and line["method"] in ("FD", "localisation") and line["pool"] != "query"
        if ours and line["value"] is not None:
            figures = found.setdefault(shown(line["obb.library"]), {})
            figures[line["figure"]] = line["value"], line["low"], line["high"]
    return lines[0]["dataset"], found


def _values(figures: Figures, names: tuple[str, ...]) -> str:
    return " / ".join(f"{figures[name][0]:.1f}" if name in figures else "–" for name in names)


def markdown(sweeps: dict[str, dict[str, Figures]]) -> str:
    """Return one table per data set."""
    parts = []
    for name, found in sweeps.items():
        lines = [f"| {name} | recall@1 / 5 / 10 | FD, X = 5 / 10 / 15 / 20 % | lc-AUROC |", "|---|---|---|---|"]
        for library, figures in found.items():
            recall, tops = _values(figures, RECALL), _values(figures, TOPS)
            area = "{:.3f} ({:.3f}–{:.3f})".format(*figures[AREA]) if AREA in figures else "–"
            lines.append(f"| {library} | {recall} | {tops} | {area} |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def draw(sweeps: dict[str, dict[str, Figures]]) -> bytes:
    """Return recall@1, what FD finds at X = 20 % and its lc-AUROC, a line per library and a colour per data set."""
    libraries = list(dict.fromkeys(library for found in sweeps.values() for library in found))
    panels = {"recall@1": "localisation recall@1, %", "top-20": "FD, found at X = 20 %", AREA: "FD, lc-AUROC"}
    with mpl.rc_context({"font.family": "DejaVu Sans", "font.size": 8}):
        figure = Figure(figsize=(12, 0.8 + 0.28 * len(libraries)), dpi=110, layout="constrained")
        FigureCanvasAgg(figure)
        for n, (axes, (key, title)) in enumerate(zip(figure.subplots(1, len(panels)), panels.items(), strict=True)):
            for i, (name, found) in enumerate(sweeps.items()):
                there = [library for library in libraries if key in found.get(library, {})]
                places = [libraries.index(library) + 0.14 * (i - (len(sweeps) - 1) / 2) for library in there]
                value, low, high = zip(*(found[library][key] for library in there), strict=True)
                axes.hlines(places, low, high, color=COLOURS[i], linewidth=0.8)
                axes.plot(value, places, MARKS[i], color=COLOURS[i], markersize=4, label=name)
            axes.set_yticks(range(len(libraries)), libraries if n == 0 else [])
            axes.set_ylim(len(libraries) - 0.5, -0.5)
            axes.set_title(title, fontsize=9)
            axes.grid(alpha=0.3)
        axes.axvline(0.5, color="0.5", linewidth=0.8, linestyle=":")
        figure.axes[0].legend(fontsize=7, loc="lower left")
        png = BytesIO()
        figure.savefig(png, format="png")
    return png.getvalue()


def main() -> None:
    """Print the tables and draw the figure."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("sweeps", nargs="+", type=Path)
    parser.add_argument("--plot", type=Path, help="PNG file to write")
    options = parser.parse_args()
    sweeps = dict(read(folder) for folder in options.sweeps)
    print(markdown(sweeps))
    if options.plot:
        write_atomically(options.plot, draw(sweeps))


if __name__ == "__main__":
    main()
