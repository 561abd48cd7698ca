"""The command line: thin commands that parse, call the library and print; one file a command.

Standard output carries the content (tables for a person, or one JSON document), standard error everything else.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave the process with its exit code.

    Parameters
    ----------
    arguments
        Without the program's name; those of the process by default.
    """
    # Ctrl-C may come while these modules are loaded.
    try:
        from pscover.cli.app import app
        from pscover.cli.output import make_printable

        make_printable()
        app.main(arguments, prog_name="pscover")
    except KeyboardInterrupt:
        from pscover.cli.fail import leave_interrupted

        sys.exit(leave_interrupted())
