"""Put tables of runs beside the paper's Table I, as Markdown.

python -m experiments.table1.compare outputs/table1/*/table.json
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from fdslam.report.paper import published


def _figures(row: dict[str, Any], percents: list[int]) -> str:
    values = [row["pooled"].get(str(x), {}).get("value") for x in percents]
    return " / ".join("–" if value is None else f"{value:.1f}" for value in values)


def comparison(tables: list[dict[str, Any]]) -> str:
    """Return one line per method: the paper's figures, then those of every table; controls and recall below.

    Args:
        tables: the contents of ``table.json`` files.
    """
    paper = published()
    percents = paper["X"]
    rows = [{row["method"]: row for row in table["rows"]} for table in tables]
    controls = [name for name in dict.fromkeys(name for row in rows for name in row) if name not in paper["rows"]]
    objects = ["no annotations" if t["boxes"] is None else f"{t['boxes']} objects" for t in tables]
    heads = [
        f"{t['dataset']} ({t['map']} map, {t['query']} queries, {o})" for t, o in zip(tables, objects, strict=True)
    ]
    lines = [f"| X = {' / '.join(map(str, percents))} % | paper, NCLT | {' | '.join(heads)} |"]
    lines.append("|---|" + "---|" * (1 + len(tables)))
    for name in [*paper["rows"], *controls]:
        theirs = " / ".join(f"{v:.1f}" for v in paper["rows"][name]) if name in paper["rows"] else "–"
        found = [_figures(table[name], percents) if name in table else "–" for table in rows]
        lines.append(f"| {name} | {theirs} | {' | '.join(found)} |")
    for name in [*paper["rows"], *controls]:
        figures = [table[name]["lc_auroc"] if name in table else {"value": None} for table in rows]
        shown = ["–" if f["value"] is None else f"{f['value']:.3f} ({f['low']:.3f}–{f['high']:.3f})" for f in figures]
        lines.append(f"| {name}, lc-AUROC | – | {' | '.join(shown)} |")
    recall = [
        " / ".join("–" if f["value"] is None else f"{f['value']:.1f}" for f in table["localization"].values())
        for table in tables
    ]
    lines.append(f"| localisation recall@1 / 5 / 10 | – | {' | '.join(recall)} |")
    return "\n".join(lines)


def main() -> None:
    """Print the comparison."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", type=Path, nargs="+", help="table.json files")
    try:
        tables = [json.loads(path.read_text(encoding="utf-8")) for path in parser.parse_args().tables]
    except (OSError, ValueError) as error:
        print(f"compare: {error}", file=sys.stderr)
        sys.exit(2)
    newest = {table["dataset"]: table for table in tables}  # folders are named by date, and listed in that order
    print(comparison(list(newest.values())))


if __name__ == "__main__":
    main()
