from fdslam.fetch import meter
from fdslam.fetch.meter import Meter, readable


def test_bytes_for_people():
    assert [readable(n) for n in (0, 999, 1000, 2_500_000, 101e9)] == ["0 B", "999 B", "1.0 kB", "2.5 MB", "101.0 GB"]


def test_without_a_terminal_a_line_now_and_then(capsys, monkeypatch):
    clock = iter([0.0, 1.0, 31.0, 31.0, 32.0, 70.0, 70.0])
    monkeypatch.setattr(meter.time, "monotonic", lambda: next(clock))
    with Meter("big", 5000) as shown:
        for done in (1000, 2000, 3000, 4000):
            shown.show(done)
    assert capsys.readouterr().err.splitlines() == ["big: 2.0 kB of 5.0 kB", "big: 4.0 kB of 5.0 kB"]
