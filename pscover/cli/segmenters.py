"""`pscover segmenters`: what finds garments in photos, and whether it can run here."""

from __future__ import annotations

from typing import Any

import click

from pscover.cli.fail import Exit
from pscover.cli.options import json_option


@click.command("segmenters", short_help="List what finds garments in photos, and how to install what is missing.")
@json_option
def command(as_json: bool) -> Exit:
    """List the segmenters: what each is, whether it can run here, and how to install it.

    Those of the SAM family need files of weights as well: see `pscover models where`.
    """
    from pscover import registry

    rows = [_row(registry.lookup("segmenter", name)) for name in registry.names("segmenter")]
    if as_json:
        from pscover.cli.output import show_document

        show_document({"segmenters": rows})
        return Exit.VERIFIED
    from rich.text import Text

    from pscover.cli.output import show
    from pscover.cli.tables import grid

    table = grid(("segmenter", "left"), ("installed", "left"), ("what", "fill"))
    for row in rows:
        installed = Text("yes", style="green") if row["installed"] else Text("no", style="yellow")
        what = row["what"] if row["installed"] else f"{row['what']}\n{row['install']}"
        table.add_row(Text(row["name"], style="bold"), installed, what)
    show(table)
    return Exit.VERIFIED


def _row(found: Any) -> dict[str, Any]:
    from pscover import registry
    from pscover.cli.parameters import parameters, summary

    absent = registry.missing(found)
    return {
        "name": found.name,
        "what": summary(found),
        "installed": not absent,
        "missing": list(absent),
        "install": f'pip install "pscover[{found.extra}]"' if found.extra else None,
        "parameters": parameters(found),
    }
