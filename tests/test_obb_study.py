"""The study's script puts what sweeps have found side by side, and takes no figure from where it does not belong."""

import sys

import pyarrow.parquet

from experiments.obb_study import libraries
from fdslam.report.sweep import Job, long_table

TEN = "A+B+C+D+E+F+G+H+I+J"


def entry(value):
    return {"value": value, "low": value - 1, "high": value + 1}


def job(number, library, value, dataset):
    def row(method, value):
        areas = dict.fromkeys(("auroc", "ap", "f1_max"), entry(-7)) | {"lc_auroc": entry(value / 100)}
        pooled = {str(x): entry(value + x) for x in (5, 10, 15, 20)}
        return {"method": method, "pooled": pooled, "per_query": dict.fromkeys(pooled, entry(-7)), **areas}

    part = {"localization": {f"recall@{n}": entry(value + n) for n in (1, 5, 10)}}
    part["rows"] = [row("FD", value), row("random", -7)]
    other = {"query_session": "a", "map_session": "b", "localization": {"recall@1": entry(-7)}, "rows": [row("FD", -9)]}
    return Job(str(number), {"obb.library": library}, {"dataset": dataset, **part, "pairs": [other]}, ("FD",))


def sweep(folder, dataset):
    folder.mkdir()
    table = long_table([job(0, "J+B", 30, dataset), job(1, f"{TEN}+YOLO", 50, dataset)])
    pyarrow.parquet.write_table(table, folder / "sweep.parquet")
    return folder


def test_tables_and_figure_of_two_data_sets(tmp_path, monkeypatch, capsys):
    folders = [str(sweep(tmp_path / name, name)) for name in ("park", "street")]
    monkeypatch.setattr(sys, "argv", ["libraries", *folders, "--plot", str(tmp_path / "out.png")])
    libraries.main()
    tables = capsys.readouterr().out.split("\n\n")
    assert [table.splitlines()[0].split(" | ")[0] for table in tables] == ["| park", "| street"]
    assert tables[0].splitlines()[2:] == [
        "| J+B | 31.0 / 35.0 / 40.0 | 35.0 / 40.0 / 45.0 / 50.0 | 0.300 (-0.700–1.300) |",
        "| A…J+YOLO | 51.0 / 55.0 / 60.0 | 55.0 / 60.0 / 65.0 / 70.0 | 0.500 (-0.500–1.500) |",
    ]
    assert (tmp_path / "out.png").read_bytes().startswith(b"\x89PNG")
