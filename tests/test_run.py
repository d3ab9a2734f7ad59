"""The command as a user meets it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from experiments.robustness.kill_and_resume import kill_and_resume
from fdslam import run
from tests.data.worlds import small_world, texture

ROOT = Path(__file__).parent.parent
QUICK = ["ad.k=2", "ad.epochs=2", "ad.folds=2", "ad.channels=4", "ad.latent=8", "ad.pixels=1024", "bow.features=300",
         "bow.min_side=240", "evaluation.bootstrap=20", "report.pictures=1"]  # fmt: skip


def command(*arguments, cwd=ROOT, python=sys.executable):
    return subprocess.run(
        [python, "-m", "fdslam.run", *map(str, arguments)], cwd=cwd, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["bow.fetures=3"], "unknown key 'bow.fetures'; near: bow.features"),
        (["+bow.foo=3"], "unknown key 'bow.foo'"),
        (["+foo=3"], "unknown key 'foo'"),
        (["dataset.rot=3"], "unknown key 'dataset.rot'; near: dataset.root"),
        (["bow.features=many"], "bow.features=many: Value 'many' of type 'str' could not be converted to Integer"),
        (["bow=foo"], "bow=foo: no such option, choose one of plain, spread"),
        (["+experiment=nope"], "experiment=nope: no such option, choose one of ad, fd"),
        (["dataset=folder"], "dataset.root is missing: give dataset.root=…"),
        (["dataset=folder", "dataset.root=/nowhere"], "dataset.root=/nowhere: no such folder"),
        (["dataset=pairs"], "dataset.root is missing: give dataset.root=…"),
        (
            ["dataset=pairs", "dataset.root=/nowhere"],
            "dataset.root=/nowhere: no such folder; give the folder that holds the",
        ),
        (["dataset=pairs", "dataset.root=."], ".: no image pairs found; looked for changesim: rgb/"),
        (
            ["dataset=pairs", "dataset.root=.", "dataset.layout=kitti"],
            "dataset.layout=kitti: choose one of auto, vl_cmu_cd",
        ),
        (["dataset=folder", "dataset.root=.", "dataset.annotations=a b.xml"], "dataset.annotations=a b.xml: not there"),
        (["dataset=nclt", "dataset.root=/nowhere"], "dataset.root=/nowhere: no such folder"),
        (["+experiment=table1", "dataset.query=AU"], "runs every pair; add dataset.all_pairs=false to choose"),
        (["dataset.query=SU"], "dataset.query=SU dataset.map=SU: choose two different sessions"),
        (["dataset=nclt", "dataset.root=."], "2012-01-22/lb3: no such session"),
        (["dataset=nclt", "dataset.root=.", "dataset.query=WT"], "dataset.query=WT: no session"),
        (["dataset=nclt", "dataset.root=.", "dataset.camera=Cam6"], "dataset.camera=Cam6: choose one of Cam0, Cam1"),
        (["fd.pooling=best"], "fd.pooling=best: choose one of min, mean, max, median"),
        (["evaluation.Y=0"], "evaluation.Y=0: out of range, it must be 1 to 1000"),
        (["obb.library=J+Q"], "unknown source 'Q', choose from A, B"),
        (["obb=yolo", "obb.yolo.weights=/nowhere/a.onnx"], "obb.yolo.weights=/nowhere/a.onnx: no such file"),
        (["obb=yolo", f"obb.yolo.weights={__file__}"], "test_run.py: not a whole ONNX model"),
        (["mask=deeplabv3plus", "mask.weights=/nowhere/b.onnx"], "mask.weights=/nowhere/b.onnx: no such file"),
        (["mask.label_map=voc"], "mask.label_map=voc: choose one of auto, ade20k32"),
        (["tracker=wandb"], "tracker=wandb: no such option, choose one of mlflow, none, tensorboard"),
        (["obb.yolo.layout=ssd"], "obb.yolo.layout=ssd: choose one of auto, yolox"),
        (["obb.yolo.score=2"], "obb.yolo.score=2.0: out of range"),
        (["+obb.yolo.foo=3"], "unknown key 'obb.yolo.foo'"),
        (["obb.yolo.cuont=3"], "unknown key 'obb.yolo.cuont'; near: obb.yolo.count"),
        (
            ["mode=tuned", "pc=gaussian"],
            "pc=gaussian sets pc.spread=gaussian, but mode=tuned sets normalised; write pc.",
        ),
        (
            ["pc=normalised"],
            "pc=normalised sets pc.spread=normalised, but mode=paper sets cell; write pc.spread=normalised to have it",
        ),
        (["device=tpu"], "device=tpu: choose cpu or cuda"),
        (["device=cuda:99"], "device=cuda:99: torch finds"),
        (["hydra.run.dir=/proc/x"], "/proc/x"),
        (["mix.rows=[FD,FD]"], "something is named twice"),
        (["dataset.kind=folder"], "dataset.kind=folder: choose one of campus"),
        (["seed=5000000000"], "seed=5000000000: out of range"),
        (["evaluation.X=[2.5]"], "evaluation.X=[2.5]: "),
        (["store=/proc/store"], "store=/proc/store: cannot be made"),
        (["nonsense"], "missing EQUAL"),
    ],
)
def test_bad_input_is_one_line_and_status_2(arguments, said, monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["fdslam.run", *arguments])
    with pytest.raises(SystemExit) as ended:
        run.main()
    assert ended.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith("fdslam: ")
    assert said in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("name", ["meine Bilder äöü", "a(1)", "[x]", "a=b", "a,b", "it's", "$x", "back\\slash"])
def test_any_folder_is_found(name, monkeypatch, tmp_path):
    root = small_world(tmp_path / name)
    monkeypatch.chdir(tmp_path)
    out = tmp_path / f"out {name}"
    monkeypatch.setattr(
        sys,
        "argv",
        ["fdslam.run", "+experiment=fd", "dataset=folder", f"dataset.root={root}", f"hydra.run.dir={out}", *QUICK],
    )
    run.main()
    assert json.loads((out / "table.json").read_text())["dataset"] == name


def test_a_failed_run_leaves_no_folder(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["fdslam.run", "ad.c=0", "hydra.run.dir=out"])
    with pytest.raises(SystemExit):
        run.main()
    assert not (tmp_path / "out").exists()


def test_a_nearly_full_disk_is_told_at_the_start(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["fdslam.run"])
    monkeypatch.setattr(run.shutil, "disk_usage", lambda _: type("Usage", (), {"free": 1_000_000}))
    with pytest.raises(SystemExit) as ended:
        run.main()
    assert ended.value.code == 2
    assert "1 MB free, at least 200 MB are needed" in capsys.readouterr().err


@pytest.mark.parametrize("fault", ["truncated image", "NaN", "box outside"])
def test_a_fault_in_the_data_is_one_line_and_leaves_no_traceback(fault, monkeypatch, capfd, tmp_path):
    root = small_world(tmp_path / "world")
    if fault == "truncated image":
        (root / "map" / "03.png").write_bytes((root / "map" / "03.png").read_bytes()[:900])
    elif fault == "NaN":
        (root / "map.csv").write_text((root / "map.csv").read_text().replace(",20", ",nan"))
    else:
        text = (root / "annotations.json").read_text().replace("[40, 60, 40, 40]", "[400, 60, 40, 40]", 1)
        (root / "annotations.json").write_text(text)
    monkeypatch.chdir(tmp_path)
    arguments = ["+experiment=fd", "dataset=folder", f"dataset.root={root}", f"store={tmp_path / 's'}", *QUICK]
    monkeypatch.setattr(sys, "argv", ["fdslam.run", *arguments])
    with pytest.raises(SystemExit) as ended:
        run.main()
    said = capfd.readouterr().err  # of compiled code as well
    lines = [line for line in said.splitlines() if line.startswith("fdslam: ")]
    assert ended.value.code == 2
    assert len(lines) == 1
    assert {"truncated image": "map/03.png", "NaN": "map.csv, line 4", "box outside": "annotation 0"}[fault] in lines[0]
    assert "Traceback" not in said


def test_help_names_groups_and_keys():
    done = command("--help")
    assert done.returncode == 0
    for word in ("fd_ad_pc", "table1", "evaluation:", "pooling: min", "dataset=folder dataset.root=DIR"):
        assert word in done.stdout


def test_what_a_run_leaves_behind(tmp_path):
    root, out = small_world(tmp_path / "world"), tmp_path / "out"
    done = command(
        "+experiment=table1", "dataset=folder", f"dataset.root={root}", f"store={tmp_path / 's'}",
        f"hydra.run.dir={out}", *QUICK, cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "FD+AD+PC" in done.stdout
    table = json.loads((out / "table.json").read_text())
    assert {"dataset", "map", "query", "boxes", "mode", "obb", "Y", "seconds", "localization", "rows"} <= table.keys()
    assert (table["dataset"], table["map"], table["query"], table["boxes"]) == ("world", 6, 6, 2)
    assert (table["mode"], table["obb"], table["Y"]) == ("paper", "J+B+BING+YOLO", 10)
    assert table["localization"].keys() == {"recall@1", "recall@5", "recall@10"}
    methods = [row["method"] for row in table["rows"]]
    assert methods[:6] == ["FD", "PC", "AD", "FD+AD+PC", "FD+AD", "FD+PC"]
    assert len(methods) == 10
    for row in table["rows"]:
        assert row["pooled"].keys() == row["per_query"].keys() == {"5", "10", "15", "20"}
        for figure in (*row["pooled"].values(), row["auroc"], row["lc_auroc"], row["ap"]):
            assert figure.keys() == {"value", "low", "high"}
            assert figure["low"] <= figure["value"] <= figure["high"]
    made = json.loads((out / "run.json").read_text())
    assert made["seed"] == 0
    assert {"versions", "threads", "git_commit", "config", "seconds"} <= made.keys()
    assert made["config"]["ad"]["epochs"] == 2
    markdown = (out / "table.md").read_text()
    assert markdown.count("\n|") == 12 + 8  # the table, and the paper beside it
    assert (out / "table.csv").read_text().startswith("method,pool,figure,value,low,high\nFD,all,top-5,")
    assert sorted(p.name for p in (out / "pictures").iterdir()) == ["best_01.png", "worst_01.png"]


def test_kills_at_random_moments_change_no_digit(tmp_path):
    root = small_world(tmp_path / "world")
    overrides = ["+experiment=fd_ad_pc", "dataset=folder", f"dataset.root={root}", *QUICK, "report.pictures=0"]
    same, shares = kill_and_resume(3, 1, overrides)
    assert same
    assert any(0.1 < share < 1 for share in shares)  # some kill fell into the work, not only into the start


def test_an_installed_wheel_runs_in_another_folder(tmp_path):
    """The wheel is built from the checkout and laid out as pip does; the dependencies are those of this environment."""
    build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(tmp_path)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("fdslam-*.whl")
    site = tmp_path / "site"
    subprocess.run(
        [
            sys.executable,
            "-m",
            "pip",
            "install",
            "--quiet",
            "--no-deps",
            "--no-index",
            "--target",
            str(site),
            str(wheel),
        ],
        check=True,
        capture_output=True,
    )
    elsewhere = tmp_path / "elsewhere"
    small_world(elsewhere / "world")
    code = (
        f"import sys; sys.path.insert(0, {str(site)!r}); import fdslam, runpy; "
        f"assert fdslam.__file__.startswith({str(site)!r}), fdslam.__file__; "
        "runpy.run_module('fdslam.run', run_name='__main__', alter_sys=True)"
    )
    done = subprocess.run(
        [sys.executable, "-P", "-c", code, "+experiment=fd", "dataset=folder", "dataset.root=world", *QUICK],
        cwd=elsewhere,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "FD" in done.stdout
    assert list(elsewhere.glob("outputs/fd/*/table.json"))


def test_textures_differ():
    assert (texture(0) != texture(1)).mean() > 0.5  # or the worlds of these tests would all be one place
