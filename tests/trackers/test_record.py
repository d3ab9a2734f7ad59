"""The record of a run against its table.json, run.json and the stored autoencoders."""

from pathlib import Path

import numpy as np

from fdslam.place_models import MODEL
from fdslam.store import Store
from fdslam.trackers.record import read_record

AREAS = {"AUROC": "auroc", "lc-AUROC": "lc_auroc", "AP": "ap", "F1-max": "f1_max"}  # as table.csv and table.json say


def told(table):
    """Every defined figure of table.json under the names of a record, by another way than the record's own."""
    entries = {("localisation", name): entry for name, entry in table["localization"].items()}
    for row in table["rows"]:
        method = row["method"]
        for pool, key in (("all", "pooled"), ("query", "per_query")):
            entries |= {(method, pool, f"top-{x}"): entry for x, entry in row[key].items()}
        entries |= {(method, "all", name): row[key] for name, key in AREAS.items()}
        for name, key in (("solo-leader", "solo_leader"), ("co-leader", "co_leader")):
            entries[(method, "all", name)] = {"value": row[key], "low": None, "high": None}
    found = {}
    for name, entry in entries.items():
        for end, written in (("value", name), *((e, (*name[:-1], f"{name[-1]} {e}")) for e in ("low", "high"))):
            if entry[end] is not None:
                found[written] = entry[end]
    return found


def test_every_figure_of_the_table_is_in_it(swept):
    record = read_record(swept.sweep / "0", "x")
    run = swept.read(0, "run.json")
    expected = told(swept.read(0, "table.json")) | {("peak memory MiB",): run["peak_memory_mib"]}
    expected |= {("seconds", stage): seconds for stage, seconds in run["seconds"].items()}
    assert record.figures == expected
    assert ("FD+AD", "query", "top-5 high") in record.figures
    assert ("localisation", "recall@5") in record.figures


def test_parameters_are_the_configuration_flat(swept):
    record = read_record(swept.sweep / "0", "x")
    assert record.parameters["ad.k"] == "2"
    assert record.parameters["obb.yolo.score"] == "0.25"
    assert record.parameters["mix.rows"] == "['FD', 'AD', 'FD+AD']"
    assert not any(key.startswith("tracker") for key in record.parameters)


def stored_losses(base):
    """What is stored of the autoencoders, in no order."""
    root = base / "outputs" / "store"
    arrays = [Store(root).get(MODEL, path.stem) for path in sorted(root.glob(f"{MODEL.name}/*/*.safetensors"))]
    return [(a["training"].tolist(), a["validation"].tolist()) for a in arrays]


def test_losses_are_those_stored_with_the_autoencoders(swept):
    curves = read_record(swept.sweep / "0", "x").curves
    assert len(curves) == 3  # a place of one image has nothing to hold out
    found = []
    for place in ("place 0", "place 1"):
        epochs = curves["training", "world", place, "L1 of each epoch"]
        folds = curves.get(("training", "world", place, "held-out L1 of each fold"), [])
        assert [step for step, _ in epochs] == [*range(1, len(epochs) + 1)]
        assert [step for step, _ in folds] in ([], [1, 2])
        found.append(([loss for _, loss in epochs], [loss for _, loss in folds]))
    stored = stored_losses(swept.base)
    assert sorted(found) == sorted(stored)
    assert np.isfinite([loss for each in stored for losses in each for loss in losses]).all()


def test_files_and_pictures_are_those_of_the_folder(swept):
    folder = swept.sweep / "0"
    record = read_record(folder, "x")
    names = {path.name for path in record.files}
    assert {"table.csv", "table.json", "table.md", "table.tex", "run.json", "training.csv"} <= names
    assert {path.name for path in record.pictures} == {"curves.png", "best_01.png", "worst_01.png"}
    assert all(isinstance(path, Path) and path.is_file() for path in (*record.files, *record.pictures))


def test_a_run_in_another_folder_is_another(swept):
    zero, one = (read_record(swept.sweep / job, "x") for job in ("0", "1"))
    assert (swept.sweep / "0" / "run.json").read_bytes() == (swept.sweep / "1" / "run.json").read_bytes()
    assert zero.identity != one.identity
