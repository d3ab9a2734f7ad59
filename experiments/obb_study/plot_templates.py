"""Draw the fixed templates of the OBB library, one panel each: python -m experiments.obb_study.plot_templates."""

from __future__ import annotations

import argparse
from io import BytesIO
from pathlib import Path

from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from fdslam.obb.templates import COLUMNS, ROWS, TEMPLATES, template_boxes
from fdslam.store import write_atomically

HEIGHT, WIDTH = 404, 308  # pixels, the campus camera


def draw() -> bytes:
    """Return the plot as PNG: the grid in grey, every box in its colour, neighbours drawn a little further inside."""
    figure = Figure(figsize=(10, 5.6), dpi=90, layout="constrained")
    FigureCanvasAgg(figure)
    for axes, name in zip(figure.subplots(2, 5).ravel(), TEMPLATES, strict=True):
        boxes = template_boxes(name, HEIGHT, WIDTH)
        for row in range(1, ROWS):
            axes.axhline(HEIGHT * row / ROWS, color="0.85", linewidth=0.6)
        for column in range(1, COLUMNS):
            axes.axvline(WIDTH * column / COLUMNS, color="0.85", linewidth=0.6)
        for i, (x0, y0, x1, y1) in enumerate(boxes):
            inset = 2 + 4 * (i % 3)
            colour = colormaps["viridis"](i / max(len(boxes) - 1, 1) * 0.9)
            corner, size = (x0 + inset, y0 + inset), (x1 - x0 - 2 * inset, y1 - y0 - 2 * inset)
            axes.add_patch(Rectangle(corner, *size, facecolor=(*colour[:3], 0.10), edgecolor=colour, linewidth=1.3))
        axes.set(xlim=(0, WIDTH), ylim=(HEIGHT, 0), aspect="equal", xticks=[], yticks=[])
        axes.set_title(f"{name}: {len(boxes)} box{'es' if len(boxes) > 1 else ''}", fontsize=10)
    png = BytesIO()
    figure.savefig(png, format="png", metadata={"Software": None})
    return png.getvalue()


def main() -> None:
    """Write the plot."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs/templates.png"))
    write_atomically(parser.parse_args().out, draw())


if __name__ == "__main__":
    main()
