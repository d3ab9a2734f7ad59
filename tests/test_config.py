import re
from dataclasses import fields
from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf

from fdslam.compose import to_config
from fdslam.config import METHODS, Bow, Campus, Config, Evaluation, Folder, Nclt, Orb, part, register
from fdslam.errors import InputError
from fdslam.modes import CONF, deviations

EXPERIMENTS = sorted(path.stem for path in (CONF / "experiment").glob("*.yaml"))
register()


def composed(*overrides):
    with initialize_config_dir(str(CONF), version_base="1.3"):
        return to_config(compose("config", overrides=list(overrides)))


def test_the_experiments_that_were_asked_for_exist():
    assert {"fd", "ad", "pc", "fd_ad", "fd_pc", "fd_ad_pc", "table1"} <= set(EXPERIMENTS)


@pytest.mark.parametrize("experiment", EXPERIMENTS)
@pytest.mark.parametrize(
    ("kind", "data"),
    [
        (Campus, []),
        (Campus, ["dataset=campus_full"]),
        (Folder, ["dataset=folder", "dataset.root=/data"]),
        (Nclt, ["dataset=nclt", "dataset.root=/data", "dataset.query=2012-01-22", "dataset.sessions=[WI,2013-01-10]"]),
    ],
)
def test_every_experiment_composes(experiment, kind, data):
    config = composed(f"+experiment={experiment}", *data)
    assert config.name == experiment
    assert config.mix.rows
    assert isinstance(config.dataset, kind)


def options():
    groups = [folder for folder in CONF.iterdir() if folder.is_dir() and folder.name not in ("experiment", "hydra")]
    return sorted(f"{folder.name}={path.stem}" for folder in groups for path in folder.glob("*.yaml"))


@pytest.mark.parametrize("option", options())
def test_every_option_of_every_group_composes(option):
    needs_root = option in ("dataset=folder", "dataset=pairs", "dataset=nclt")
    extra = ["dataset.root=/data"] if needs_root else []
    assert composed(option, *extra).mix.rows


def test_a_session_of_nclt_is_a_word_and_not_a_date():
    data = composed("dataset=nclt", "dataset.root=/data", "dataset.map=2012-01-22", "dataset.camera=Cam0").dataset
    assert (data.query, data.map, data.camera) == ("", "2012-01-22", "Cam0")
    assert len(data.sessions) == 4


def test_table1_has_the_six_rows_of_the_paper():
    assert composed("+experiment=table1").mix.rows == list(METHODS)


def test_paper_mode_is_the_schema_s_default():
    # The mode names its switches; the schema's defaults say the same, so that the library and the command agree.
    config, plain = composed("mode=paper"), Config()
    for group in ("bow", "fd", "ad", "pc", "mask", "evaluation", "obb"):
        ours, default = getattr(config, group), getattr(plain, group)
        assert {f.name: getattr(ours, f.name) for f in fields(ours)} == {
            f.name: getattr(default, f.name) for f in fields(default)
        }, group


def test_the_paper_s_comparison_is_of_exact_sifts_in_their_cells():
    changed = {"pc.spread": "normalised", "pc.descriptors": "pq"}
    config = composed("mode=paper", *(f"{key}={value}" for key, value in changed.items()))
    assert deviations(config) == changed


@pytest.mark.parametrize("mode", ["paper", "tuned"])
def test_a_mode_is_what_its_file_says_whatever_the_groups(mode):
    config = composed("bow=plain", "pc=gaussian", f"mode={mode}")
    assert config.mode == mode
    assert deviations(config) == {}
    assert deviations(composed(f"mode={mode}", "fd.gate=7")) == {"fd.gate": 7}
    assert deviations(composed(f"mode={mode}", "pc.spread=gaussian")) == {"pc.spread": "gaussian"}


@pytest.mark.parametrize(
    ("override", "named"),
    [
        ("bow.features=0", "bow.features=0"),
        ("bow.ratio=1.5", "bow.ratio=1.5"),
        ("ad.c=0", "ad.c=0"),
        ("ad.c=nan", "ad.c=nan"),
        ("fd.pooling=best", "fd.pooling=best"),
        ("evaluation.X=[5,0]", "evaluation.X=0"),
        ("evaluation.X=[]", "evaluation.X=[]"),
        ("mix.rows=[]", "mix.rows=[]"),
        ("mix.rows=[FD,XY]", "mix.rows=XY"),
        ("mix.rows=[CC+XY]", "mix.rows=CC+XY: 'XY' is no detector; choose from FD, PC, AD, CC"),
        ("mix.rows=[CC+FD+CC]", "mix.rows=CC+FD+CC: a detector is named twice"),
        ("mix.rows=[CC+]", "mix.rows=CC+: '' is no detector"),
        ("dataset.images=0", "dataset.images=0"),
        ("dataset.query=WINTER", "dataset.query=WINTER"),
        ("dataset.query=SU", "dataset.query=SU dataset.map=SU"),
        ("seed=-1", "seed=-1"),
    ],
)
def test_a_value_out_of_range_is_named(override, named):
    with pytest.raises(InputError, match=re.escape(named)):
        composed(override)


def test_a_list_may_be_empty_only_where_its_option_says_so():
    assert composed("dataset=folder", "dataset.root=/data", "dataset.classes=[]").dataset.classes == []
    assert composed("dataset=folder", "dataset.root=/data", "dataset.classes=[car,2]").dataset.classes == ["car", "2"]
    with pytest.raises(InputError, match="something is named twice"):
        composed("dataset=folder", "dataset.root=/data", "dataset.classes=[car,car]")


def test_true_is_a_choice_and_not_a_truth_value():
    assert composed("evaluation.viewpoint=true").evaluation.viewpoint == "true"


def test_a_missing_value_is_named():
    with pytest.raises(InputError, match=r"dataset\.root"):
        composed("dataset=folder")


def test_a_stage_is_addressed_by_its_own_fields_alone():
    assert part(Bow(), Orb).keys() == {"features", "grid", "min_side", "fast_threshold"}


def test_every_key_says_what_it_means():
    def walk(cls):
        for f in fields(cls):
            if OmegaConf.is_missing(OmegaConf.structured(cls), f.name):
                continue
            if f.default_factory is not None and isinstance(f.default_factory, type):
                yield from walk(f.default_factory)
            else:
                yield cls.__name__, f

    silent = [(name, f.name) for name, f in walk(Config) if not f.metadata.get("help")]
    assert silent == []


def test_the_configuration_lies_beside_the_package():
    assert (Path(CONF) / "config.yaml").is_file()
    assert Evaluation().X == [5, 10, 15, 20]
