"""Trees made in several threads at once."""

import ast
import gc
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from fdslam import syntax
from fdslam.store import code_version


@pytest.fixture
def yielding():
    """Every garbage collection lets another thread in, as one that runs finalizers does; and there are many."""

    def let_in(phase, _):
        if phase == "stop":
            time.sleep(1e-5)

    before = gc.get_threshold()
    gc.callbacks.append(let_in)
    gc.set_threshold(50)
    yield
    gc.set_threshold(*before)
    gc.callbacks.remove(let_in)


def test_threads_do_not_disturb_each_other(yielding):
    source = "from fdslam.a import b\n" + "x = [(1, {2: [3, (4, 5)]}), lambda: (6, 7)]\n" * 100
    with ThreadPoolExecutor(6) as threads:
        trees = list(threads.map(syntax.parse, [source] * 6))
    assert [ast.dump(tree) for tree in trees] == [ast.dump(ast.parse(source))] * 6


def test_the_code_version_is_the_same_in_every_thread(yielding):
    code_version.cache_clear()
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(code_version, ["fdslam.pipeline"] * 4))
    code_version.cache_clear()
    assert found == [code_version("fdslam.pipeline")] * 4


def test_no_python_is_a_syntax_error():
    with pytest.raises(SyntaxError):
        syntax.parse("1 +", mode="eval")
