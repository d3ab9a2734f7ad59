"""The accuracy table for a paper: LaTeX with booktabs."""

from __future__ import annotations

import re

from fdslam.config import Config
from fdslam.metrics import Figure
from fdslam.pipeline import Outcome
from fdslam.report.paper import published

_SPECIAL = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    **{c: f"\\{c}" for c in "&%$#_{}"},
}


def escaped(text: str) -> str:
    """Return text that LaTeX prints as it is."""
    return re.sub(r"[\\~^&%$#_{}]", lambda found: _SPECIAL[found[0]], text)


def _cell(figure: Figure | None, digits: int) -> str:
    if figure is None:
        return "--"
    return f"{figure.value:.{digits}f} {{\\scriptsize ({figure.low:.{digits}f}--{figure.high:.{digits}f})}}"


def table_latex(outcome: Outcome, config: Config) -> str:
    """Return a ``table`` environment: top-X accuracy with intervals, lc-AUROC, and the paper's rows below."""
    percents = sorted(set(config.evaluation.X))
    heads = ["method", *(f"$X={x}\\,\\%$" for x in percents), "lc-AUROC"]
    lines = [
        "% needs \\usepackage{booktabs}",
        "\\begin{table}",
        "\\centering",
        f"\\caption{{Changed objects found in the top $X\\,\\%$ of all cells, $Y={config.evaluation.Y}$, "
        f"on {escaped(outcome.dataset.name)}; {round(100 * config.evaluation.confidence)}\\,\\% intervals.}}",
        f"\\begin{{tabular}}{{l{'r' * (len(heads) - 1)}}}",
        "\\toprule",
        " & ".join(heads) + " \\\\",
        "\\midrule",
    ]
    for i, row in enumerate(outcome.rows):
        if i == len(config.mix.rows):
            lines.append("\\midrule")
        cells = [_cell(row.pooled[x], 1) for x in percents]
        lines.append(" & ".join([escaped(row.method), *cells, _cell(row.lc_auroc, 3)]) + " \\\\")
    if published()["X"] == percents:
        theirs = {name: published()["rows"][name] for name in config.mix.rows if name in published()["rows"]}
        lines.append("\\midrule")
        for name, values in theirs.items():
            cells = [f"{value:.1f}" for value in values]
            lines.append(" & ".join([f"{escaped(name)}, the paper on NCLT", *cells, "--"]) + " \\\\")
    lines += ["\\bottomrule", "\\end{tabular}", "\\end{table}"]
    return "\n".join(lines) + "\n"
