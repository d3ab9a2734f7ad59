"""One thread a test, as in a run's workers, and examples without a clock: the machine may be shared."""

from pathlib import Path

import pytest
from hypothesis import settings

from fdslam.progress import single_threaded

settings.register_profile("fdslam", deadline=None, max_examples=60)
settings.load_profile("fdslam")
single_threaded()

TOGETHER = ("trackers",)  # folders whose files share what is costly to make


@pytest.hookimpl(tryfirst=True)  # before pytest-xdist looks at the marks
def pytest_collection_modifyitems(items):
    """Where several processes share the tests, those of a file stay together: what they share is then made once."""
    for item in items:
        path = Path(item.nodeid.partition("::")[0])
        item.add_marker(pytest.mark.xdist_group(str(path.parent if path.parent.name in TOGETHER else path)))
