"""`pscover bench`: the paper's experiments on time, measured here, and a page of all that was measured."""

from __future__ import annotations

import importlib

import click

from pscover.errors import UnknownName

COMMANDS = {"table2": "bench_table2", "groups": "bench_groups", "study": "bench_study", "report": "bench_report"}
"""In the order of `--help`; each is `command` in the module of that name."""


class Benches(click.Group):
    """A group that imports a subcommand when it runs."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """All of them, in the order of a first day's work."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command:
        """The command of that name; unknown names get a suggestion."""
        if cmd_name not in COMMANDS:
            raise click.UsageError(str(UnknownName.among("bench", cmd_name, COMMANDS)), ctx)
        found: click.Command = importlib.import_module(f"pscover.cli.{COMMANDS[cmd_name]}").command
        return found


@click.group("bench", cls=Benches, short_help="Measure times as in the paper, and make a page of all results.")
def command() -> None:
    """Measure how times grow with garments and groups as in the paper, and make one page of everything measured."""
