"""The command `pscover`: its subcommands, found by name and imported when they are asked for."""

from __future__ import annotations

import importlib
import sys
import textwrap
from collections.abc import Sequence
from typing import Any

import click

import pscover
from pscover.cli.fail import MEANING, Exit, report
from pscover.errors import UnknownName

COMMANDS = (
    *("plan", "segment", "solve", "verify", "info", "compare", "convert", "generate", "simulate", "calibrate", "bench"),
    *("backends", "formulations", "segmenters", "models", "doctor"),
)
"""In the order of `--help`; each is `command` in the module of that name."""

WIDTH = 90
"""Columns of help, where the terminal has as many."""
EXAMPLES = """\b
Examples:
  pscover plan photo.jpg --html report.html
  pscover segment photo.jpg -o photo.labels.png
  pscover generate garments --count 12 --seed 1 -o table.png
  pscover solve instance.json --time 5 -o result.json
  pscover verify instance.json result.json
  pscover compare instance.json --backends highs,greedy
"""


class Program(click.Group):
    """A group that imports a subcommand when it runs, and turns every error into one line and an exit code."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """All commands, in the order of a first day's work."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command:
        """The command of that name; unknown names get a suggestion."""
        if cmd_name not in COMMANDS:
            raise click.UsageError(str(UnknownName.among("command", cmd_name, COMMANDS)), ctx)
        found: click.Command = importlib.import_module(f"pscover.cli.{cmd_name}").command
        return found

    def make_context(self, info_name: str | None, args: list[str], *rest: Any, **extra: Any) -> click.Context:
        """Parse; `--help` and `--version` are printed here, perhaps to a reader that went away."""
        try:
            return super().make_context(info_name, args, *rest, **extra)
        except BrokenPipeError as error:
            raise click.exceptions.Exit(report(error)) from None

    def invoke(self, ctx: click.Context) -> Any:
        """Run the subcommand; whatever it raises ends as a line on standard error."""
        try:
            code = super().invoke(ctx)
            sys.stdout.flush()
        except click.exceptions.Exit as exit_:
            code = exit_.exit_code
        except (Exception, KeyboardInterrupt) as error:
            code = report(error)
        return code

    def main(  # type: ignore[override]  # click's overloads tell standalone runs from others; this one is always standalone
        self, args: Sequence[str] | None = None, prog_name: str | None = None, **extra: Any
    ) -> Any:
        """Run and leave the process with the exit code."""
        extra["standalone_mode"] = False
        try:
            code = super().main(args, prog_name, **extra)
        except Exception as error:
            code = report(error)
        sys.exit(int(code) if isinstance(code, int) else int(Exit.VERIFIED))


def _ending() -> str:
    wide = textwrap.TextWrapper(width=72, subsequent_indent=" " * 7)
    lines = "\n".join(wide.fill(f"  {code.value:>3}  {meaning}") for code, meaning in MEANING.items())
    return f"{EXAMPLES}\n\b\nExit codes:\n{lines}\n"


@click.group(
    cls=Program, epilog=_ending(), context_settings={"help_option_names": ["-h", "--help"], "max_content_width": WIDTH}
)
@click.version_option(pscover.__version__, prog_name="pscover")
def app() -> None:
    """Plan how a robot clears garments with few trips, as probabilistic set cover, and prove how good the plan is."""
