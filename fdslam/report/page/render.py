"""Templates, styles and scripts become one file that asks for nothing outside of itself."""

from __future__ import annotations

import hashlib
from base64 import b64encode
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup

from fdslam.report.page.images import colour_bar

STATIC = Path(__file__).parent / "static"


def as_json(value: Any) -> Markup:
    """Return a value as JSON that may stand in HTML's ``<script>``, whatever the texts in it are."""
    return htmlsafe_json_dumps(value, separators=(",", ":"), allow_nan=False)


def render(template: str, scripts: tuple[str, ...], **values: Any) -> bytes:
    """Return a page.

    Args:
        template: its file in ``templates``.
        scripts: files in ``static`` that make up its script, one after the other.
        values: what the template names.
    """
    style = (STATIC / "report.css").read_text(encoding="utf-8").replace("HEAT_COLOURS", colour_bar())
    script = "\n".join(['"use strict";', *((STATIC / name).read_text(encoding="utf-8") for name in scripts)])
    allowed = b64encode(hashlib.sha256(script.encode()).digest()).decode()  # this script and no other may run
    page = _environment().get_template(template)
    text = page.render(style=Markup(style), script=Markup(script), script_hash=allowed, **values)
    return text.encode(errors="backslashreplace")  # names of files need not be valid Unicode


@cache
def _environment() -> Environment:
    found = Environment(
        loader=PackageLoader("fdslam.report.page"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    found.filters["json"] = as_json
    return found
