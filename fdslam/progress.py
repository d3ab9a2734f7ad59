"""Work in parallel threads, with a progress bar on a terminal and plain lines elsewhere."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from contextvars import ContextVar
from functools import lru_cache, partial
from typing import TypeVar

import cv2
from threadpoolctl import ThreadpoolController
from tqdm import tqdm

T = TypeVar("T")
PLAIN_SECONDS = 10.0  # between two plain lines


def say(line: str) -> None:
    """Tell the user something, on standard error."""
    print(line, file=sys.stderr, flush=True)


def readable(count: float) -> str:
    """Return a number of bytes for people."""
    for unit in ("B", "kB", "MB"):
        if count < 1000:
            return f"{count:.0f} {unit}" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1000
    return f"{count:.1f} GB"


@lru_cache(maxsize=1)
def _libraries(modules: int) -> ThreadpoolController:
    """Return the numerical libraries that are loaded; looking for them takes longer than many a job."""
    return ThreadpoolController()


def single_threaded() -> None:
    """Let this thread's numerical libraries run on one core: parallelism is over images, and results stay the same."""
    _libraries(len(sys.modules)).limit(limits=1)  # BLAS and OpenMP of what is loaded by now: modules bring libraries
    cv2.setNumThreads(1)
    if "torch" in sys.modules:  # the import takes seconds, and some stages do without
        sys.modules["torch"].set_num_threads(1)


_guests = 0  # of ``single_threaded_inside``
_guest_lock = threading.Lock()
_before: list[Callable[[], object]] = []  # sets again what was set for the whole program before the first guest


def _limit_program() -> None:
    blas = _libraries(len(sys.modules)).select(user_api="blas")
    _before[:] = [partial(cv2.setNumThreads, cv2.getNumThreads()), blas.limit(limits=1).restore_original_limits]
    cv2.setNumThreads(1)


def _undo() -> None:
    for undo in _before:
        undo()


def _by_a_passing_thread(work: Callable[[], None]) -> None:
    """Do what counts for the whole program: a thread that sets OpenBLAS keeps others from it for as long as it lives.

    The last to leave is seldom the first who came.
    """
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()


@contextmanager
def single_threaded_inside() -> Iterator[None]:
    """As ``single_threaded``, as long as anyone is inside: a program that uses fdslam has its own settings back."""
    global _guests
    torch = sys.modules.get("torch")
    own = None if torch is None else torch.get_num_threads()
    openmp = _libraries(len(sys.modules)).select(user_api="openmp").limit(limits=1)  # it counts for each thread alone
    if torch is not None:
        torch.set_num_threads(1)
    with _guest_lock:
        if not _guests:
            _by_a_passing_thread(_limit_program)
        _guests += 1
    try:
        yield
    finally:
        with _guest_lock:
            _guests -= 1
            if not _guests:
                _by_a_passing_thread(_undo)
        openmp.restore_original_limits()
        if torch is not None:
            torch.set_num_threads(own)


def worker_count(workers: int) -> int:
    """Return the number of workers: ``workers``, or one per available core for 0."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return workers or cores or 1


_silent: ContextVar[bool] = ContextVar("silent", default=False)


@contextmanager
def silence(silent: bool = True) -> Iterator[None]:
    """Show no progress of what this thread does inside, if ``silent``; else leave it as it is."""
    token = _silent.set(silent or _silent.get())
    try:
        yield
    finally:
        _silent.reset(token)


def progress(items: Iterable[T], total: int, label: str) -> Iterator[T]:
    """Yield the items, showing how many are done and how fast: a bar on a terminal, else a line every ten seconds."""
    if _silent.get():
        yield from items
        return
    if sys.stderr.isatty():
        yield from tqdm(items, total=total, desc=label, unit="it", dynamic_ncols=True)
        return
    start = last = time.monotonic()
    done = 0
    for done, item in enumerate(items, 1):
        yield item
        if time.monotonic() - last >= PLAIN_SECONDS:
            last = time.monotonic()
            print(f"{label}: {done}/{total}, {done / (last - start):.1f}/s", file=sys.stderr, flush=True)
    if done:
        print(f"{label}: {done}/{total} in {time.monotonic() - start:.1f} s", file=sys.stderr, flush=True)


def in_parallel(jobs: Iterable[Callable[[], T]], workers: int) -> Iterator[T]:
    """Run the jobs in threads (the libraries below release the interpreter) and yield results as they finish.

    At most twice as many jobs as workers are in hand, so that memory stays bounded; the first error ends it, and the
    jobs not yet begun are dropped.
    """
    count = worker_count(workers)
    with ThreadPoolExecutor(count, initializer=single_threaded) as pool:
        pending: set[Future[T]] = set()
        try:
            for job in jobs:
                pending.add(pool.submit(job))
                if len(pending) >= 2 * count:
                    done, pending = wait(pending, return_when=FIRST_COMPLETED)
                    yield from (future.result() for future in done)
            while pending:
                done, pending = wait(pending, return_when=FIRST_COMPLETED)
                yield from (future.result() for future in done)
        finally:
            for future in pending:
                future.cancel()
