"""`pscover formulations`: the ways to write an instance as a model."""

from __future__ import annotations

from typing import Any

import click

from pscover.cli.fail import Exit
from pscover.cli.options import json_option


@click.group(
    "formulations", invoke_without_command=True, short_help="List the formulations; `show NAME` prints the mathematics."
)
@json_option
@click.pass_context
def command(ctx: click.Context, as_json: bool) -> Exit | None:
    """List the formulations: what each is, how it stands to the problem, and its parameters.

    \b
    Examples:
      pscover formulations
      pscover formulations show clique
    """
    if ctx.invoked_subcommand is not None:
        return None
    from pscover import registry

    rows = [_row(registry.lookup("formulation", name)) for name in registry.names("formulation")]
    if as_json:
        from pscover.cli.output import show_document

        show_document({"formulations": rows})
        return Exit.VERIFIED
    from rich.text import Text

    from pscover.cli.output import show
    from pscover.cli.tables import grid

    table = grid(("formulation", "left"), ("relation", "left"), ("what", "fill"), ("parameters", "fill"))
    for row in rows:
        options = "\n".join(f"{p['name']}={p['default']}" for p in row["parameters"])
        table.add_row(Text(row["name"], style="bold"), row["relation"], row["what"], options)
    show(table)
    return Exit.VERIFIED


@command.command("show")
@click.argument("name")
def show_one(name: str) -> Exit:
    """Print what formulation NAME is: its mathematics, size, use and source."""
    from pscover import registry
    from pscover.gallery import card

    click.echo(card(registry.lookup("formulation", name).name))
    return Exit.VERIFIED


def _row(found: Any) -> dict[str, Any]:
    from pscover.cli.parameters import parameters, summary

    return {
        "name": found.name,
        "what": summary(found),
        # With the parameters' defaults: some formulations can be more than one thing.
        "relation": found().relation,
        "parameters": parameters(found),
    }
