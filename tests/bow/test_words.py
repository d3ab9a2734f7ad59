import os
import subprocess
import sys

import numpy as np
import pytest

from fdslam import native
from fdslam.bow import hamming, pivots
from fdslam.bow import words as module
from fdslam.bow.words import Words
from fdslam.progress import in_parallel
from tests.bow.test_hamming import descriptors
from tests.bow.test_pivots import nearest_by_loops


@pytest.fixture(autouse=True)
def short_lists(monkeypatch):
    monkeypatch.setattr(pivots, "WORDS_PER_PIVOT", 4)  # so that small sets have many lists too


@pytest.fixture(params=["compiled", "numpy"])
def path(request, monkeypatch):
    for place in (hamming, module, pivots):
        monkeypatch.setattr(place, "NATIVE", request.param == "compiled")


def distinct(seed, count):
    return np.unique(descriptors(seed, 2 * count), axis=0)[np.random.default_rng(seed).permutation(count)]


def grown(words, exact_below, probes=16, step=700):
    result = Words(exact_below, probes)
    for begin in range(0, len(words), step):
        result.append(words[begin : begin + step])
    return result


def by_definition(words, search, queries):
    """The two nearest in the lists of the probed pivots, all by plain distances: oracle of the lists."""
    home = [min(nearest_by_loops(search._pivots, word, 1))[1] for word in words]
    result = []
    for query in queries:
        probed = {pivot for _, pivot in nearest_by_loops(search._pivots, query, search.depth)}
        inside = [w for w in range(len(words)) if home[w] in probed]
        near = sorted((int(hamming.distances(query[None], words[w][None])[0, 0]), w) for w in inside)
        result.append(near[:2])
    return result


@pytest.mark.usefixtures("path")
def test_lists_hold_what_the_definition_says():
    words, queries = distinct(0, 2000), descriptors(5, 12)
    search = grown(words, exact_below=500)
    keys = search.two_nearest(queries)
    found = [list(zip(hamming.distance_of(row), hamming.id_of(row), strict=True)) for row in keys]
    assert found == by_definition(words, search, queries)


@pytest.mark.usefixtures("path")
def test_exact_while_small():
    words, queries = distinct(1, 600), descriptors(6, 20)
    exact = hamming.two_nearest_keys(*hamming.pack(words), queries)
    assert np.array_equal(grown(words, exact_below=601, step=37).two_nearest(queries), exact)


def test_both_paths_are_one(monkeypatch):
    words, queries = distinct(2, 1500), descriptors(7, 60)
    native = grown(words, 400).two_nearest(queries)
    for place in (hamming, module, pivots):
        monkeypatch.setattr(place, "NATIVE", False)
    slow = grown(words, 400).two_nearest(queries)
    assert np.array_equal(native, slow)


def test_a_word_is_always_found_again():
    words = distinct(3, 3000)
    keys = grown(words, 500, probes=8).two_nearest(words)
    assert hamming.id_of(keys[:, 0]).tolist() == list(range(3000))
    assert (hamming.distance_of(keys[:, 0]) == 0).all()


def test_more_probes_find_more():
    words, queries = distinct(4, 3000), np.random.default_rng(0).integers(0, 256, (300, 32), dtype=np.uint8)
    exact = hamming.two_nearest_keys(*hamming.pack(words), queries)[:, 0]
    recall = [np.mean(grown(words, 500, probes).two_nearest(queries)[:, 0] == exact) for probes in (8, 16, 32, 64)]
    assert recall == sorted(recall)
    assert recall[0] < recall[-1] > 0.4


def test_order_batch_steps_and_threads_change_nothing():
    words, queries = distinct(5, 3000), descriptors(8, 90)
    search = grown(words, 500)
    whole = search.two_nearest(queries)
    order = np.random.default_rng(1).permutation(len(queries))
    assert np.array_equal(search.two_nearest(queries[order]), whole[order])
    one_by_one = np.concatenate([search.two_nearest(query[None]) for query in queries])
    assert np.array_equal(one_by_one, whole)

    def part(i):
        return i, search.two_nearest(queries[10 * i : 10 * i + 10])

    parts = dict(in_parallel([lambda i=i: part(i) for i in range(9)], 3))
    assert np.array_equal(np.concatenate([parts[i] for i in range(9)]), whole)
    for step in (13, 1500, 3000):
        assert np.array_equal(grown(words, 500, step=step).two_nearest(queries), whole)


def test_stored_words_find_the_same_and_go_on_growing():
    words, queries = distinct(6, 3000), descriptors(9, 50)
    for limit in (500, 5000):
        first = grown(words[:2000], limit)
        arrays = {name: array.copy() for name, array in first.arrays().items()}
        again = Words.from_arrays(arrays, limit, 16)
        assert len(again) == 2000
        assert np.array_equal(again.two_nearest(queries), first.two_nearest(queries))
        again.append(words[2000:2003])
        again.append(words[2003:])
        first.append(words[2000:])
        assert np.array_equal(again.two_nearest(queries), first.two_nearest(queries))
        assert np.array_equal(again.descriptors(), words)


def test_nothing_finds_nothing():
    empty = Words(10_000, 32)
    assert (empty.two_nearest(descriptors(0, 3)) == hamming.NONE).all()
    empty.append(np.zeros((0, 32), np.uint8))
    assert len(empty) == 0
    assert empty.descriptors().shape == (0, 32)
    assert grown(distinct(0, 300), 280).two_nearest(np.zeros((0, 32), np.uint8)).shape == (0, 2)


WITHOUT = """
import sys
sys.modules["numba"] = None
import logging, numpy as np
logging.basicConfig(format="%(message)s")
from fdslam.bow import pivots, words
pivots.WORDS_PER_PIVOT = 4
rng = np.random.default_rng(0)
search = words.Words(500, 16)
words.Words(500, 16)
search.append(rng.integers(0, 256, (1500, 32), dtype=np.uint8))
print(search.two_nearest(rng.integers(0, 256, (20, 32), dtype=np.uint8)).sum())
"""


def test_a_machine_without_numba_says_so_once_and_finds_the_same():
    done = subprocess.run([sys.executable, "-c", WITHOUT], capture_output=True, text=True, check=True)
    assert done.stderr.count("numba is not installed") == 1
    rng = np.random.default_rng(0)
    search = Words(500, 16)
    search.append(rng.integers(0, 256, (1500, 32), dtype=np.uint8))
    expected = search.two_nearest(rng.integers(0, 256, (20, 32), dtype=np.uint8)).sum()
    assert int(done.stdout) == int(expected)


def test_a_processor_without_popcount_instructions_finds_the_same(tmp_path):
    environment = {**os.environ, "NUMBA_CPU_NAME": "generic", "NUMBA_CACHE_DIR": str(tmp_path)}
    program = WITHOUT.replace('sys.modules["numba"] = None', "")
    run = [
        subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, env=env).stdout
        for env in (environment, dict(os.environ))
    ]
    assert run[0] == run[1]


def test_what_makes_the_search_slow_is_said_once(monkeypatch, caplog):
    native.say_what_is_slow.cache_clear()
    monkeypatch.setattr(native.binding, "get_host_cpu_features", dict)
    Words(500, 16)
    Words(500, 16)
    assert [record.message for record in caplog.records] == [
        "no AVX-512 popcount on this machine: the word search is slower here, with the same result"
    ]
    native.say_what_is_slow.cache_clear()
