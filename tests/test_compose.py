"""A configuration from words, wherever the program stands that asks for it."""

from concurrent.futures import ThreadPoolExecutor

import hydra
from hydra.core.global_hydra import GlobalHydra

from fdslam.compose import configured

WORDS = ["dataset=folder", "dataset.root=."]


def test_threads_compose_at_the_same_time_each_its_own():
    def composed(number):
        config = configured([*WORDS, f"mode={('paper', 'best')[number % 2]}", f"evaluation.Y={number + 1}"])
        return config.mode, config.evaluation.Y

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(composed, range(4)))
    assert found == [(("paper", "best")[number % 2], number + 1) for number in range(4)]


def test_a_program_that_hydra_runs_may_compose_and_keeps_its_own(tmp_path):
    (tmp_path / "robot.yaml").write_text("speed: 2\n")
    with hydra.initialize_config_dir(str(tmp_path), version_base="1.3"):
        assert configured([*WORDS, "evaluation.Y=3"]).evaluation.Y == 3
        assert hydra.compose("robot").speed == 2
    assert not GlobalHydra.instance().is_initialized()
