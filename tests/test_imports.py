"""The house rule that modules import one way: each can be imported first, whatever a run happens to import before."""

import ast
import importlib
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import experiments
import fdslam

ROOT = Path(fdslam.__file__).parent


def modules():
    for path in ROOT.rglob("*.py"):
        parts = path.relative_to(ROOT.parent).with_suffix("").parts
        yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


FILES = dict(modules())


def needed(name, path):
    """The modules that must be there before this one: what it imports outside of functions, and their packages."""
    found = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    for one in [*found]:
        parts = one.split(".")
        found |= {".".join(parts[:i]) for i in range(1, len(parts))}
    around = {".".join(name.split(".")[:i]) for i in range(1, name.count(".") + 2)}
    return {one for one in found if one in FILES and one not in around}  # its own packages are begun before it


def test_no_module_needs_one_that_needs_it():
    graph = {name: needed(name, path) for name, path in FILES.items()}
    assert len(graph) > 150
    assert "fdslam.config.options" in graph["fdslam.config.compact"]
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        raise AssertionError(" needs ".join(reversed(error.args[1]))) from None


def test_every_experiment_can_be_imported():
    """They are run by hand, so that a name that is gone would be found late."""
    folder = Path(experiments.__file__).parent
    names = {".".join(path.relative_to(folder.parent).with_suffix("").parts) for path in folder.rglob("*.py")}
    assert len(names) > 60
    for name in sorted(names):
        importlib.import_module(name)
