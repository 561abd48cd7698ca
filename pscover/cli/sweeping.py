"""A sweep as commands run it: a bar while it works, and a word on how to go on when it is interrupted."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pscover.cli.fail import Exit, say
from pscover.cli.live import advancing
from pscover.cli.options import FILE

if TYPE_CHECKING:
    from rich.console import RenderableType

    from pscover.evidence.tables import Table

output_option = click.option(
    *("--output", "-o"), type=FILE, required=True, metavar="DIR", help="Folder of the results; a run goes on there."
)
INTERVAL = re.compile(r" \([^()]*(–| to )[^()]*\)$")


def swept(run: Callable[[Callable[[Any, Any], None]], object], total: int, *, quiet: bool) -> Exit:
    """Run a sweep of so many cases, which is given what to call after each; says how it ended."""
    count = 0
    with advancing(total, quiet=quiet) as advance:

        def done(case: Any, row: Any) -> None:
            nonlocal count
            count += 1
            advance(str(case))

        try:
            run(done)
        except KeyboardInterrupt:
            say(f"interrupted after {count} of {total} cases; the same command goes on with the rest")
            return Exit.INTERRUPTED
    return Exit.VERIFIED


def checked_limit(limit: float) -> float:
    """The same; raises unless it is a positive number of seconds."""
    from pscover.errors import InvalidSettings

    if not 0 < limit < math.inf:
        raise InvalidSettings(f"--limit: expected a positive number of seconds, got {limit:g}")
    return limit


def pictured(draw: Callable[[], Path], *, quiet: bool) -> list[Path]:
    """The picture that is drawn, where matplotlib is installed; a note otherwise."""
    from pscover.errors import MissingDependency

    try:
        return [draw()]
    except MissingDependency as missing:
        if not quiet:
            say(f"note: no picture: {missing}")
        return []


def write_tables(tables: list[Table], folder: Path) -> list[Path]:
    """Each as CSV, and all in one Markdown file."""
    from pscover.files import write_bytes

    written = []
    for table in tables:
        written.append(folder / f"{table.name}.csv")
        write_bytes(written[-1], table.csv().encode())
    parts = ["\n\n".join((f"## {table.title}", table.markdown(), *table.notes)) for table in tables]
    written.append(folder / f"{tables[0].name}.md")
    write_bytes(written[-1], ("\n\n".join(parts) + "\n").encode())
    return written


def print_tables(tables: list[Table], *, as_json: bool) -> None:
    """On standard output, with their notes; intervals are in the JSON document only."""
    from pscover.cli.output import screen, show, show_document

    if as_json:
        show_document({table.name: [dict(zip(table.columns, row, strict=True)) for row in table.rows] for table in tables})
        return
    width = screen().width
    for k, table in enumerate(tables):
        show(*([""] if k else []), table.title, *_shown(table, width), *table.notes)


def _shown(table: Table, width: int) -> Iterator[RenderableType]:
    """The table in as many parts as the terminal is too narrow for, each with the first column."""
    from pscover.cli.tables import grid

    # A terminal has no room for intervals: the files have them.
    rows = [[INTERVAL.sub("", cell) for cell in row] for row in table.rows]
    widths = [
        max(len(text) for text in (*name.split(), *(row[k] for row in rows), "")) + 1 for k, name in enumerate(table.columns)
    ]
    for part in _parts(widths, width):
        names = [table.columns[k] for k in part]
        shown = grid(*((name, "left" if name in table.text_columns else "right") for name in names))
        for column in shown.columns:
            column.no_wrap = False
        for row in rows:
            shown.add_row(*(row[k] for k in part))
        yield shown


def _parts(widths: Sequence[int], most: int) -> list[list[int]]:
    """Columns that fit beside each other, the first one always among them.

    Examples
    --------
    >>> _parts([10, 20, 20, 30], 60)
    [[0, 1, 2], [0, 3]]
    """
    parts = [[0]]
    for k in range(1, len(widths)):
        if len(parts[-1]) > 1 and sum(widths[place] for place in parts[-1]) + widths[k] > most:
            parts.append([0])
        parts[-1].append(k)
    return parts
