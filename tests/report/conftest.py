"""One run of a small world for all tests of the report, its names as awkward as a file system allows."""

import pytest

from fdslam.config import Report
from fdslam.pipeline import run
from fdslam.provenance import Stopwatch
from tests.data.worlds import small_world
from tests.test_pipeline import config_for, folder

NAME = 'wörld <script>alert(1) "q" \'&lt; {:02d}'


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """Configuration, outcome, and a folder of their own."""
    base = tmp_path_factory.mktemp("report")
    world = small_world(base / "wörld <b> $x$", name=NAME)
    config = config_for(folder(world), base / "store", report=Report(pictures=2))
    return config, run(config, Stopwatch()), base
