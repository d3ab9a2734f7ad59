import subprocess
import sys
import threading
import time
from functools import partial

import pytest

import fdslam.progress
from fdslam.progress import in_parallel, progress, single_threaded, worker_count


@pytest.mark.parametrize("workers", [1, 3])
def test_every_job_runs_once(workers):
    done = []
    assert sorted(in_parallel((partial(lambda i: done.append(i) or i, i) for i in range(20)), workers)) == list(
        range(20)
    )
    assert sorted(done) == list(range(20))


def test_an_error_ends_it_and_the_rest_is_not_begun():
    begun = []

    def job(i):
        begun.append(i)
        if i == 2:
            raise ValueError("third")
        time.sleep(0.01)

    with pytest.raises(ValueError, match="third"):
        list(in_parallel((partial(job, i) for i in range(500)), 2))
    assert len(begun) < 20


def test_few_jobs_are_in_hand_at_a_time():
    taken, gate = [], threading.Event()

    def jobs():
        for i in range(100):
            taken.append(i)
            yield partial(gate.wait, 5)

    results = in_parallel(jobs(), 2)
    threading.Timer(0.2, lambda: (taken.append("open"), gate.set())).start()
    next(results)
    assert taken.index("open") <= 4


def test_plain_lines_without_a_terminal(capsys):
    assert list(progress(iter("abc"), 3, "letters")) == ["a", "b", "c"]
    assert "letters: 3/3 in" in capsys.readouterr().err
    assert list(progress(iter(""), 0, "nothing")) == []
    assert capsys.readouterr().err == ""


def test_every_worker_limits_the_libraries_and_finds_new_ones(monkeypatch):
    looked, limited = [], []

    class Controller:
        def __init__(self):
            looked.append(len(sys.modules))

        def limit(self, limits):
            limited.append(limits)

    monkeypatch.setattr(fdslam.progress, "ThreadpoolController", Controller)
    fdslam.progress._libraries.cache_clear()
    single_threaded()
    for _ in range(3):
        assert list(in_parallel([int, int], 2)) == [0, 0]
    assert {*limited} == {1}
    assert len(limited) >= 4  # an executor may make one worker of two
    assert len(looked) == 1
    monkeypatch.setitem(sys.modules, "a.new.library", sys)
    single_threaded()
    assert len(looked) == 2
    fdslam.progress._libraries.cache_clear()


def test_workers_default_to_the_cores():
    assert worker_count(3) == 3
    assert worker_count(0) >= 1


KEEPS = """
import threading
import cv2, numpy, torch
from threadpoolctl import ThreadpoolController
from fdslam.progress import single_threaded_inside

def settings():
    blas = {one["num_threads"] for one in ThreadpoolController().select(user_api="blas").info()}
    return torch.get_num_threads(), cv2.getNumThreads(), blas

def guest(entered, wait_for, left):
    torch.set_num_threads(3)
    with single_threaded_inside():
        entered.set()
        wait_for.wait()
        inside.append(settings())
    after.append(torch.get_num_threads())
    left.set()

inside, after = [], []
cv2.setNumThreads(2)
setter = threading.Thread(target=lambda: ThreadpoolController().select(user_api="blas").limit(limits=2))
setter.start()
setter.join()
before = settings()
with single_threaded_inside():
    assert settings() == (1, 1, {1}), settings()
assert settings() == before, settings()
a, b, a_left = threading.Event(), threading.Event(), threading.Event()
first = threading.Thread(target=guest, args=(a, b, a_left))
first.start()
a.wait()
second = threading.Thread(target=guest, args=(b, a_left, threading.Event()))
second.start()
first.join()
second.join()
assert inside == [(1, 1, {1})] * 2, inside
assert after == [3, 3], after
assert settings() == before, settings()
"""


def test_a_program_has_its_threads_back_whoever_leaves_last():
    done = subprocess.run([sys.executable, "-c", KEEPS], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
