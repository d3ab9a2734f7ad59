"""Sweeps: finished jobs are not repeated, a faulty job does not stop the others, and all land in one table."""

import csv
import json
import shutil
import subprocess
import sys

import pyarrow.parquet
import pytest

from fdslam.config import Config, Folder
from fdslam.errors import InputError
from fdslam.finished import files, finished, signature
from fdslam.report.sweep import Job, long_table, short_table, write_sweep
from fdslam.report.sweep_figures import draw
from fdslam.sweep import note_failure, reused, unfinish
from tests.data.worlds import small_world
from tests.test_run import QUICK, command

VALUES = ("value", "low", "high")


def number(text):
    return float(text) if text else None


def lines(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A sweep over c and Y in which c = 0 is impossible: its folder, and what the command said."""
    base = tmp_path_factory.mktemp("sweep")
    small_world(base / "world")
    done = command(
        "-m", "+experiment=fd_ad", "ad.c=0.8,2,0", "evaluation.Y=1,3", "obb=j_b", "dataset=folder",
        "dataset.root=world", *QUICK, "report.pictures=0", cwd=base,
    )  # fmt: skip
    (folder,) = (base / "outputs" / "fd_ad").glob("*_sweep")
    return base, folder, done


def test_a_faulty_job_is_told_and_the_others_are_done(swept):
    _, folder, done = swept
    assert done.returncode == 2
    assert (folder / "4" / "error.txt").read_text() == "ad.c=0.0: out of range, it must be 1e-06 to 1000000.0\n"
    told = [line for line in done.stderr.splitlines() if line.startswith("fdslam: ")]
    assert len(told) == 3
    assert "jobs 4, 5 of " in told[-1]
    assert "Traceback" not in done.stderr
    assert sorted(path.parent.name for path in folder.glob("*/run.json")) == ["0", "1", "2", "3"]


def test_one_long_table_holds_what_every_job_found(swept):
    _, folder, _ = swept
    found = lines(folder / "sweep.csv")
    stored = pyarrow.parquet.read_table(folder / "sweep.parquet")
    assert stored.column_names == list(found[0])
    assert stored.column_names[:3] == ["job", "ad.c", "evaluation.Y"]
    assert len(stored) == len(found)
    for job in ("0", "1", "2", "3"):
        mine = [line for line in found if line["job"] == job]
        config = json.loads((folder / job / "run.json").read_text())["config"]
        assert {line["ad.c"] for line in mine} == {f"{config['ad']['c']:g}"}
        assert {line["evaluation.Y"] for line in mine} == {str(config["evaluation"]["Y"])}
        for line in lines(folder / job / "table.csv"):
            if line["figure"].endswith("leader"):
                continue
            [same] = [m for m in mine if all(m[key] == line[key] for key in ("method", "pool", "figure"))]
            assert [number(same[key]) for key in VALUES] == [number(line[key]) for key in VALUES]
    recall = [line for line in found if line["method"] == "localisation"]
    assert {line["figure"] for line in recall} == {"recall@1", "recall@5", "recall@10"}
    for name in ("over_X.png", "over_ad_c.png", "over_evaluation_Y.png"):
        assert (folder / name).read_bytes().startswith(b"\x89PNG")


def test_c_changes_no_ranking(swept):
    """METHOD: c is shared by all AEs, so it scales every LoC alike."""
    _, folder, _ = swept
    by_c = {}
    for line in lines(folder / "sweep.csv"):
        key = tuple(line[k] for k in ("evaluation.Y", "method", "pool", "figure"))
        by_c.setdefault(line["ad.c"], {})[key] = [line[k] for k in VALUES]
    assert by_c["0.8"] == by_c["2"]


def test_finished_jobs_are_not_repeated_and_a_parallel_sweep_says_the_same(swept):
    base, folder, _ = swept
    done = command(
        "-m", "+experiment=fd_ad", "ad.c=0.8,2", "evaluation.Y=1,3,5", "obb=j_b", "dataset=folder",
        "dataset.root=world", *QUICK, "report.pictures=0", "hydra/launcher=joblib", "hydra.launcher.n_jobs=2",
        "workers=1", "hydra.sweep.dir=outputs/fd_ad/again_sweep", cwd=base,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("finished before, in ") == 4  # other workers are no other result; Y = 5 is new
    again = base / "outputs" / "fd_ad" / "again_sweep"
    assert len(list(again.glob("*/run.json"))) == 6
    keys = ("evaluation.Y", "ad.c", "method", "pool", "figure", *VALUES)
    first = {tuple(line[k] for k in keys) for line in lines(folder / "sweep.csv")}
    assert first < {tuple(line[k] for k in keys) for line in lines(again / "sweep.csv")}


def test_a_job_is_finished_only_by_the_same_code_on_the_same_files(tmp_path, monkeypatch):
    root = small_world(tmp_path / "world")
    config = Config(dataset=Folder(root=str(root)))
    wanted = signature(config, {"obb": []})
    done = tmp_path / "done"
    done.mkdir()
    (done / "run.json").write_text(json.dumps({**wanted, "seconds": {}}))
    assert finished(wanted, [tmp_path / "nowhere", done]) == done
    assert (
        finished(signature(Config(dataset=Folder(root=str(root)), workers=7, store="x"), {"obb": []}), [done]) == done
    )
    assert finished(signature(Config(dataset=Folder(root=str(root)), seed=1), {"obb": []}), [done]) is None
    assert finished(signature(config, {"obb": ["other weights"]}), [done]) is None
    assert finished({**wanted, "code": "another"}, [done]) is None
    (root / "query" / "new.png").write_bytes(b"x")
    assert finished(signature(config, {"obb": []}), [done]) is None
    for damaged in ("", "[]", "{}", '{"config": 3}', json.dumps(wanted)[:-9]):
        (done / "run.json").write_text(damaged)
        assert finished(wanted, [done]) is None


def test_results_are_whole_before_run_json_says_so(tmp_path, monkeypatch):
    wanted = signature(Config(), {})
    old, new = tmp_path / "old", tmp_path / "sweep" / "0"
    (old / "pictures").mkdir(parents=True)
    (old / "run.json").write_text(json.dumps(wanted))
    (old / "table.json").write_text("{}")
    (old / "pictures" / "a.png").write_text("x")
    new.mkdir(parents=True)
    (new / "error.txt").write_text("once it failed")
    assert not reused(new, "run", wanted)  # beside the sweep, but not under the name of the runs
    shutil.move(old, tmp_path / "sweep" / "old")

    def killed(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("fdslam.sweep.write_atomically", killed)
        with pytest.raises(KeyboardInterrupt):
            reused(new, "run", wanted)
    assert not (new / "run.json").exists()
    assert reused(new, "run", wanted)
    assert sorted(path.name for path in new.iterdir()) == ["pictures", "run.json", "table.json"]


def _table(value):
    entry = {"value": value, "low": value, "high": value}
    row = {"method": "FD", "pooled": {"5": entry}, "per_query": {"5": entry}}
    areas = dict.fromkeys(("auroc", "lc_auroc", "ap", "f1_max"), entry)
    return {"dataset": "d", "localization": {"recall@1": entry}, "rows": [row | areas], "pairs": []}


def test_keys_of_several_kinds_and_undefined_values():
    jobs = [
        Job("0", {"a.side": "auto", "a.x": 1}, _table(None), ("FD",)),
        Job("1", {"a.side": 640, "a.x": 1.5}, _table(0.25), ("FD",)),
    ]
    table = long_table(jobs)
    assert set(table["a.side"].to_pylist()) == {"auto", "640"}
    assert set(table["a.x"].to_pylist()) == {1.0, 1.5}
    assert table["value"].null_count == len(table) // 2
    assert short_table(jobs) == [
        ["a.side", "a.x", "method", "X = 5 %", "lc-AUROC", "recall@1"],
        ["auto", "1", "FD", "–", "–", "–"],
        ["640", "1.5", "FD", "0.2", "0.250", "0.2"],
    ]


def test_files_are_watched_through_links_and_home(tmp_path, monkeypatch):
    root = small_world(tmp_path / "home" / "world")
    shutil.move(root / "map", tmp_path / "disk")
    (root / "map").symlink_to(tmp_path / "disk")
    (root / "query" / "back").symlink_to(root)  # a link that leads back ends nothing
    (tmp_path / "home" / "world.json").write_text("{}")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    configs = [
        Folder(root=str(root), annotations="../world.json"),
        Folder(root="~/world"),
    ]
    before = [files(Config(dataset=one)) for one in configs]
    assert before == [files(Config(dataset=one)) for one in configs]
    (tmp_path / "disk" / "00.png").write_bytes(b"another image")
    after = [files(Config(dataset=one)) for one in configs]
    assert all(a != b for a, b in zip(before, after, strict=True))
    (tmp_path / "home" / "world.json").write_text("{ }")
    assert files(Config(dataset=configs[0])) != after[0]
    assert files(Config(dataset=configs[1])) == after[1]


def test_a_folder_that_is_written_to_again_is_not_finished(tmp_path, monkeypatch):
    wanted = signature(Config(), {})
    other, new = tmp_path / "0", tmp_path / "1"
    other.mkdir()
    (other / "run.json").write_text(json.dumps(wanted))
    copied = shutil.copytree

    def begun(*arguments, **options):
        copied(*arguments, **options)
        unfinish(other)  # as its own job does when it begins

    monkeypatch.setattr("fdslam.sweep.shutil.copytree", begun)
    assert not reused(new, "run", wanted)
    assert not (new / "run.json").exists()
    (new / "run.json").write_text(json.dumps(wanted))
    note_failure(new, InputError("no"))
    assert sorted(path.name for path in new.iterdir()) == ["error.txt"]


def test_figures_show_every_method_and_leave_out_what_has_no_such_key(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr("fdslam.report.sweep.draw", lambda *given: drawn.append(given) or draw(*given))
    for number, (kind, rows) in enumerate({"campus": ["FD"], "folder": ["FD", "AD"]}.items()):
        (tmp_path / str(number)).mkdir()
        data = {"kind": kind} | ({"root": "photos"} if kind == "folder" else {})
        text = json.dumps({"config": {"dataset": data, "mix": {"rows": rows}}})
        (tmp_path / str(number) / "run.json").write_text(text)
        table = _table(0.5)
        table["rows"] = [{**table["rows"][0], "method": method} for method in rows]
        (tmp_path / str(number) / "table.json").write_text(json.dumps(table))
    write_sweep(tmp_path)
    assert drawn[0][2] == ["FD", "AD"]
    names = {path.name for path in tmp_path.glob("*.png")}
    assert names == {"over_X.png", "over_dataset_kind.png", "over_dataset_root.png", "over_mix_rows.png"}


@pytest.mark.parametrize("what", ["nothing", "torn table"])
def test_what_cannot_be_gathered_is_one_line(what, tmp_path):
    if what == "torn table":
        (tmp_path / "0").mkdir()
        (tmp_path / "0" / "run.json").write_text(json.dumps({"config": {}}))
        (tmp_path / "0" / "table.json").write_text("{")
    with pytest.raises(Exception, match="no job has finished" if what == "nothing" else "not a whole run folder") as e:
        write_sweep(tmp_path)
    assert type(e.value).__name__ == "InputError"


def test_a_run_that_is_no_sweep_does_not_load_what_draws_sweeps():
    code = "import sys, fdslam.run; print([m for m in ('pyarrow', 'matplotlib', 'torch') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
