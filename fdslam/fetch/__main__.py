"""The command ``python -m fdslam.fetch NAME``: 0 done, 2 something the user can mend (one line), 130 interrupted."""

from __future__ import annotations

import argparse
import sys
from typing import NoReturn

from fdslam.errors import InputError
from fdslam.fetch import FETCHERS

USAGE_ERROR, INTERRUPTED = 2, 130


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Say what is wrong in one line, as all commands do."""
        self.exit(USAGE_ERROR, f"fdslam: {message}; see {self.prog} --help\n")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return the exit status."""
    parser = _Parser(prog="python -m fdslam.fetch", description="Download what fdslam does not ship.")
    names = parser.add_subparsers(dest="name", metavar="NAME", required=True)
    for name, fetcher in FETCHERS.items():
        fetcher.arguments(names.add_parser(name, help=fetcher.summary, description=fetcher.summary))
    options = parser.parse_args(arguments)
    try:
        FETCHERS[options.name].fetch(options)
    except InputError as error:
        print(f"fdslam: {error}", file=sys.stderr)
        return USAGE_ERROR
    except KeyboardInterrupt:
        print("\nfdslam: interrupted; what has arrived is kept, run the same command again to go on", file=sys.stderr)
        return INTERRUPTED
    return 0


if __name__ == "__main__":
    sys.exit(main())
