"""Python's syntax trees, made by one thread at a time.

Python 3.11 counts the depth of the tree it makes in one place for all threads, and takes another thread's levels for a
fault of its own (SystemError "AST constructor recursion depth mismatch") when a garbage collection lets that one in.
Only those that come here wait for each other: ``ast.parse`` elsewhere in the process does not.
"""

from __future__ import annotations

import ast
import threading

_one_thread = threading.RLock()  # the collection may run a finalizer of this very thread that wants a tree too


def parse(source: str, mode: str = "exec") -> ast.AST:
    """Return the tree of ``source``: a module, or one expression with ``mode="eval"``.

    Raises:
        SyntaxError: it is not Python.
    """
    with _one_thread:
        return ast.parse(source, mode=mode)
