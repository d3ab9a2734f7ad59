"""Compiled kernels where numba is at hand; elsewhere the slower paths beside them give the same numbers.

Kernels are compiled when first called and kept on disk beside the module, so that a second process only loads them.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import cache
from typing import Any

log = logging.getLogger(__name__)

try:
    import numba
    from llvmlite import binding
except ImportError:
    numba = None  # type: ignore[assignment]
NATIVE = numba is not None


def njit(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function on its first call, to run without the interpreter's lock; without numba, leave it as it is."""
    return function if numba is None else numba.njit(cache=True, nogil=True)(function)


@cache
def say_what_is_slow() -> None:
    """Say once, on a machine without numba or AVX-512 popcount, that the search of words is slower there."""
    if numba is None:
        log.warning(
            "numba is not installed: the word search takes its slower path, with the same result; pip install numba"
        )
    elif not binding.get_host_cpu_features().get("avx512vpopcntdq", False):
        log.warning("no AVX-512 popcount on this machine: the word search is slower here, with the same result")
