"""Questions that only the user can answer, before something is downloaded or trusted."""

from __future__ import annotations

import sys

from fdslam.errors import InputError


def confirm(question: str, yes: bool, refusal: str) -> None:
    """Go on if the user says yes, on the command line or at the terminal.

    Args:
        question: asked at the terminal.
        yes: ``--yes`` was given.
        refusal: the line for any other answer, and for none where there is no terminal.

    Raises:
        InputError: the refusal.
    """
    if yes:
        return
    if not sys.stdin.isatty():
        raise InputError(refusal)
    sys.stderr.write(f"{question} Type yes: ")
    sys.stderr.flush()
    if sys.stdin.readline().strip().lower() != "yes":
        raise InputError(refusal)
