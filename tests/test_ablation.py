"""The rows of the ablation are what their names say. Oracle: the modes' files."""

import pytest

from experiments.ablation.ablation import ALONE, NOT_USED, config, fd_variants, fusion_variants, mode
from fdslam.config import Campus, Config, Obb
from fdslam.fusion import RULES
from fdslam.modes import deviations


def made(switches):
    return config(Campus(kind="campus"), Obb(), switches, ["FD"], "store")


def differences(one, two):
    return {
        f"{group}.{key}"
        for group in ("bow", "fd", "pc", "ad", "mix", "evaluation")
        for key, value in vars(getattr(one, group)).items()
        if value != getattr(getattr(two, group), key) and key != "rows"
    }


def test_the_first_row_is_the_papers_and_every_switch_is_there_with_and_without():
    rows = dict(fd_variants())
    paper, tuned = made(rows["mode=paper"]), made(rows["mode=tuned"])
    assert differences(paper, Config()) == set()
    assert deviations(paper) == {}
    for name, switch in ALONE.items():
        keys = {f"{group}.{key}" for group, values in switch.items() for key in values}
        assert differences(made(rows[f"paper, {name}"]), paper) == keys
        assert differences(made(rows[f"tuned without {name}"]), tuned) == keys
        assert keys <= differences(tuned, paper)
    for name, switch in NOT_USED.items():
        assert differences(made(rows[f"tuned, {name}"]), tuned)
        assert all(mode("tuned")[group].get(key) != value for group, v in switch.items() for key, value in v.items())
    # What tuned has of FD and its words is all among the switches that are shown alone.
    alone = {f"{group}.{key}" for switch in ALONE.values() for group, values in switch.items() for key in values}
    assert {key for key in differences(tuned, paper) if key.split(".")[0] in ("bow", "fd")} == alone


@pytest.mark.parametrize("rule", RULES)
def test_fusions_differ_in_their_rule_alone(rule):
    rows = dict(fusion_variants())
    assert made(rows[f"mode=tuned, {rule}"]).mix.rule == rule
    assert differences(made(rows[f"mode=tuned, {rule}"]), made(mode("tuned"))) <= {"mix.rule"}
