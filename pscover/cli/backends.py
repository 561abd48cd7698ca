"""`pscover backends`: the engines, and whether they can run here."""

from __future__ import annotations

from typing import Any

import click

from pscover.cli.fail import Exit
from pscover.cli.options import json_option


@click.command("backends", short_help="List the engines, and how to install those that are missing.")
@json_option
def command(as_json: bool) -> Exit:
    """List the engines: what each is, whether it proves optimality, whether it can run here, and how to install it."""
    from pscover import registry

    rows = [_row(registry.lookup("backend", name)) for name in registry.names("backend")]
    if as_json:
        from pscover.cli.output import show_document

        show_document({"backends": rows})
        return Exit.VERIFIED
    from rich.text import Text

    from pscover.cli.output import show
    from pscover.cli.tables import grid

    table = grid(("backend", "left"), ("exact", "left"), ("installed", "left"), ("what", "fill"))
    for row in rows:
        installed = Text("yes", style="green") if row["installed"] else Text("no", style="yellow")
        what = row["what"] if row["installed"] else f"{row['what']}\n{row['install']}"
        table.add_row(Text(row["name"], style="bold"), "yes" if row["exact"] else "no", installed, what)
    show(table)
    return Exit.VERIFIED


def _row(found: Any) -> dict[str, Any]:
    from pscover import registry
    from pscover.cli.parameters import parameters, summary

    absent = registry.missing(found)
    return {
        "name": found.name,
        "what": summary(found),
        "exact": found.exact,
        "installed": not absent,
        "missing": list(absent),
        "install": f'pip install "pscover[{found.extra}]"' if found.extra else None,
        "parameters": parameters(found),
    }
