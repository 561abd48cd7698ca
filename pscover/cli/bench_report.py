"""`pscover bench report`: all results as one HTML page, and as Markdown."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from pscover.cli.fail import Exit, say
from pscover.cli.options import FILE, json_option, quiet_option

if TYPE_CHECKING:
    from pscover.evidence.results import File

USUAL = Path("bench/results")
PLANS = ((12, "apart"), (35, "apart"), (20, "piled"))
"""Garments and layout of the scenes whose plans are shown."""


@click.command("report", short_help="One HTML page of all results.")
@click.option(
    "--results",
    "folders",
    type=FILE,
    multiple=True,
    metavar="DIR",
    help="Folder of results, or of folders of results; repeatable.  [default: bench/results]",
)
@click.option("--output", "-o", type=FILE, required=True, metavar="FILE.html", help="The page.")
@click.option("--markdown", type=FILE, metavar="FILE.md", help="The same words and numbers as Markdown.")
@click.option("--plans/--no-plans", default=True, show_default=True, help="Plan some painted scenes for pictures.")
@json_option
@quiet_option
def command(folders: tuple[Path, ...], output: Path, markdown: Path | None, plans: bool, as_json: bool, quiet: bool) -> Exit:
    """Put everything that was measured into one HTML file that needs nothing else: tables, pictures, raw data.

    What is not there is said in the page and on standard error, with the command that makes it.

    \b
    Examples:
      pscover bench report -o report.html
      pscover bench report --results table2/ --results groups/ --no-plans -o report.html --markdown results.md
    """
    from pscover.cli.output import require_distinct, require_writable, show_document, wrote
    from pscover.errors import InvalidResult
    from pscover.evidence.page import render_page
    from pscover.evidence.results import KNOWN, missing, require, sections
    from pscover.evidence.results import markdown as as_markdown
    from pscover.files import write_bytes

    require_writable(output, suffixes=(".html", ".htm"))
    require_writable(markdown, suffixes=(".md",))
    require_distinct(output, markdown)
    if not folders and not USUAL.is_dir():
        raise InvalidResult(f"--results: expected a folder of results, got none, and there is no {USUAL} here")
    given = folders or (USUAL,)
    found = sections(given)
    require(found, given)
    gone = missing(found)
    write_bytes(output, render_page(found, _plans(quiet=quiet) if plans else ()))
    if markdown is not None:
        write_bytes(markdown, as_markdown(found).encode())
    if as_json:
        show_document({"sections": [section.name for section in found], "missing": gone})
    if not quiet:
        for name in gone:
            say(f"note: no results of {name}: {KNOWN[name][1]}")
        wrote(output, f"{len(found)} sections")
        if markdown is not None:
            wrote(markdown, "the same as Markdown")
    return Exit.VERIFIED


def _plans(*, quiet: bool) -> list[File]:
    """Pictures of plans for painted scenes, where the packages for them are installed."""
    from pscover.errors import MissingDependency
    from pscover.evidence.results import File
    from pscover.figures.plan import render_plan
    from pscover.generate.garments import Layout, garments
    from pscover.generate.paint import paint
    from pscover.planning import plan

    layouts: dict[str, Layout] = {"apart": "apart", "piled": "piled"}
    try:
        return [
            File(
                name=f"{count} garments, {layout}",
                media="image/png",
                content=render_plan(plan(paint(garments(count, seed=1, layout=layouts[layout]), 1), time=20.0)),
            )
            for count, layout in PLANS
        ]
    except MissingDependency as missing:
        if not quiet:
            say(f"note: no pictures of plans: {missing}")
        return []
