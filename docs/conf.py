"""The documentation as a site: ``make docs``.

The source folder is the top of the checkout, so the README and the pages beside the code are pages where they are, and
a link between them leads to the same place here and on a code host.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from importlib.metadata import version as installed
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.ext.napoleon import GoogleDocstring
from sphinx.pycode import parser

from fdslam.config.options import Checked

project, author, copyright = "fdslam", "the fdslam project", "the fdslam project"
version = release = installed("fdslam")
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "README"
include_patterns = ["README.md", "docs/*.md", "docs/api/*.rst", "experiments/*/README.md", "fdslam/weights/*.md"]
exclude_patterns = [".venv", ".git", "outputs", "tests", "conf", "dist"]  # not even walked
templates_path = ["templates"]
myst_heading_anchors = 3  # as code hosts have them
suppress_warnings = ["ref.python"]  # one name for two things, such as Dataset: as data and as configuration

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True, "ignore-module-all": True}  # a name stands where it is defined
napoleon_use_rtype = False
add_module_names = False
# What other libraries call theirs cannot be looked up without a network; every name of the project's own must be found.
# Of the embedded world only the door is described.
nitpick_ignore_regex = [(r"py:.*", r"(?!fdslam\b).*"), (r"py:.*", r"fdslam\.(data\.campus\.\w+\.\w+|progress\.T)")]

html_theme = "furo"
html_title = "fdslam"
html_additional_pages = {"index": "to_readme.html"}
html_static_path, html_css_files = ["static"], ["site.css"]
html_show_sphinx = False
html_copy_source = False

CONTENTS = (Path(__file__).parent / "contents.txt").read_text()
# In this project any comment beside a field says what it is, not only one that begins with "#:"; and what stands before
# a colon in it is no type.
parser.comment_re = re.compile(r"^\s*#:? ?(.*)\r?\n?$")
GoogleDocstring._consume_inline_attribute = lambda self: ("", self._dedent(self._consume_to_end()))


def add_contents(app: Sphinx, name: str, source: list[str]) -> None:
    """Give the README the table of contents, which would be noise on a code host."""
    if name == root_doc:
        source[0] += CONTENTS


def to_modules(app: Sphinx, doctree: nodes.document) -> None:
    """Let a link to a module's file, which a code host shows, lead to its description here, not to a download."""
    for link in [*doctree.findall(addnodes.download_reference)]:
        path = Path(link["reftarget"].lstrip("/"))
        if path.suffix == ".py" and "fdslam" in path.parts:
            name = ".".join(path.with_suffix("").parts[path.parts.index("fdslam") :])
            module = addnodes.pending_xref("", *link.children, refdomain="py", reftype="mod", reftarget=name)
            link.replace_self(module)
            module["refdoc"] = app.env.docname


def keep_figures_together(app: Sphinx, doctree: nodes.document) -> None:
    """Break no line between the figures of a cell, such as 7.8 / 15.8: wide tables are scrolled."""
    for cell in doctree.findall(nodes.entry):
        for text in [*cell.findall(nodes.Text)]:
            if re.fullmatch(r"[\d.,–…/ ()%]+", text):
                text.parent.replace(text, nodes.Text(text.replace(" ", "\N{NO-BREAK SPACE}")))


def as_rst(app: Sphinx, what: str, name: str, found: object, options: object, lines: list[str]) -> None:
    """Mend what people read as it is meant and reStructuredText does not: |x|, and a list that begins without a gap."""
    mended: list[str] = []
    for line in lines:
        if line.startswith("- ") and mended and mended[-1] and not mended[-1].startswith(("- ", "  ")):
            mended.append("")
        parts = line.split("``")
        mended.append("``".join(part if i % 2 else part.replace("|", r"\|") for i, part in enumerate(parts)))
    lines[:] = mended


def add_options(app: Sphinx, what: str, name: str, found: object, options: object, lines: list[str]) -> None:
    """Put a table of its keys below the docstring of a group of the configuration."""
    if not (isinstance(found, type) and issubclass(found, Checked) and is_dataclass(found)):
        return
    rows = [(f.name, f) for f in fields(found) if "help" in f.metadata]
    if not rows:
        return
    lines += ["", ".. list-table::", "   :header-rows: 1", "", "   * - key", "     - default", "     - what"]
    for key, field in rows:
        default = field.default if field.default is not MISSING else field.default_factory()  # type: ignore[misc]
        lines += [
            f"   * - ``{key}``",
            f"     - ``{default!r}``",
            f"     - {field.metadata['help']}{allowed(field.metadata)}",
        ]
    lines.append("")


def allowed(declared: Mapping[str, Any]) -> str:
    """Return the range of a key, or what it may be, in brackets."""
    low, high = declared["low"], declared["high"]
    if declared["choices"]:
        return f" ({', '.join(f'``{choice}``' for choice in declared['choices'] if choice != '')})"
    if low is None and high is None:
        return ""
    return f" (at least {low})" if high is None else f" ({low} to {high})"


def setup(app: Sphinx) -> None:
    """Connect what is added."""
    sys.path.insert(0, str(Path(__file__).parent.parent))
    app.connect("source-read", add_contents)
    app.connect("doctree-read", to_modules, priority=100)  # before downloads are collected
    app.connect("doctree-read", keep_figures_together)
    app.connect("autodoc-process-docstring", add_options, priority=50)
    app.connect("autodoc-process-docstring", as_rst, priority=100)  # both before napoleon, whose priority is 500
