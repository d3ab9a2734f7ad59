import pytest

from fdslam.fetch import download


@pytest.fixture(autouse=True)
def at_once(monkeypatch):
    """No pause before another try, no proxy of the surroundings, and small pieces, so that files have many."""
    monkeypatch.setattr(download, "PAUSES", (0.0, 0.0))
    monkeypatch.setattr(download, "CHUNK", 1000)
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    for name in ("http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"):
        monkeypatch.delenv(name, raising=False)
