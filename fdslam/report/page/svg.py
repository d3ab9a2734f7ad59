"""Matplotlib's figures as SVG inside the page: text and axes take the colour of the text around them."""

from __future__ import annotations

import re
from collections.abc import Callable
from io import StringIO
from typing import Any

import matplotlib as mpl
from markupsafe import Markup, escape
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

INK = "#010203"  # stands for the colour of the text, and is used for nothing else
STYLE: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "text.color": INK,
    "text.parse_math": False,
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.framealpha": 0.0,
    "svg.fonttype": "none",  # text stays text
    "svg.hashsalt": "fdslam",  # the same figure is the same bytes
}
ROOT = 12.0  # points of CSS's 16 pixels, a rem
_NOTHING = dict.fromkeys(("Creator", "Date", "Format", "Type"))


def panel(draw: Callable[[Axes], None], said: str, legend: bool = True) -> Markup:
    """Return one panel.

    Args:
        draw: draws on the axes.
        said: what the figure shows, for those who do not see it.
        legend: whether it names what it shows.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(5.6, 4.2 if legend else 3.6), layout="constrained")
        axes = figure.subplots()
        draw(axes)
        if legend:
            figure.legend(fontsize=8, loc="outside lower center", ncols=4)
        return inline(figure, said)


def inline(figure: Figure, said: str) -> Markup:
    """Return a figure that was drawn in ``STYLE`` as an element of HTML."""
    with mpl.rc_context(STYLE):
        figure.patch.set_alpha(0)
        for axes in figure.axes:
            axes.patch.set_alpha(0)
        held = StringIO()
        FigureCanvasSVG(figure).print_svg(held, metadata=_NOTHING)
    text = held.getvalue()
    text = text[text.index("<svg") :].replace(INK, "currentColor")
    text = re.sub(r"<style.*?</style>", "", text, flags=re.DOTALL)  # it would style the whole page
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r'<g id="[^"]*"', "<g", text)  # the same in every figure, and nothing refers to them
    wide = figure.get_figwidth() * 72 / ROOT
    shown = f'<svg style="--width: {wide:.1f}rem" role="img" aria-label="{escape(said)}"'
    return Markup(re.sub(r'<svg([^>]*?) width="[^"]*" height="[^"]*"', lambda tag: shown + tag[1], text, count=1))
