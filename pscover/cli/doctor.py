"""`pscover doctor`: what is installed, what is missing and how to get it, and where weights are looked for."""

from __future__ import annotations

import os
import platform
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pscover.cli.fail import Exit
from pscover.cli.options import json_option

if TYPE_CHECKING:
    from rich.text import Text

    from pscover.doctor import Part


@click.command("doctor", short_help="Say what is installed, what is missing, and how to get it.")
@json_option
def command(as_json: bool) -> Exit:
    """Say what is installed of all that pscover can use, what is missing and the line that brings it, and where weights of
    segmenters are looked for.

    Exit code 3 if the core itself is not complete; extras may be missing.
    """
    import pscover
    from pscover.doctor import parts
    from pscover.perception.models import CATALOGUE, find, folders

    found = parts()
    places = {weights.file: find(weights) for weights in CATALOGUE}
    code = Exit.VERIFIED if found[0].is_complete else Exit.MISSING
    if as_json:
        from pscover.cli.output import show_document

        rows = [
            {
                "extra": part.extra,
                "complete": part.is_complete,
                "packages": [{"name": p.name, "needed": p.needed, "found": p.found} for p in part.packages],
                "install": part.install,
            }
            for part in found
        ]
        show_document(
            {
                "version": pscover.__version__,
                "python": platform.python_version(),
                "parts": rows,
                "weights": places,
                "folders": folders(),
            }
        )
        return code
    from rich.text import Text

    from pscover.cli.output import show
    from pscover.cli.tables import facts, grid

    show(
        facts(
            [
                ("pscover", f"{pscover.__version__}, in {Path(pscover.__file__).parent}"),
                ("python", f"{platform.python_version()} on {platform.system()} {platform.machine()}"),
                ("processors", f"{len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else os.cpu_count()}"),
            ]
        ),
        "",
    )
    table = grid(("extra", "left"), ("there", "left"), ("packages", "fill"))
    for part in found:
        table.add_row(Text(part.extra or "(core)", style="bold"), _verdict(part), _packages(part))
    weights = [(name, "not found" if path is None else str(path)) for name, path in places.items()]
    show(table, "", facts([*weights, ("looked for in", ", ".join(map(str, folders())))]))
    return code


def _verdict(part: Part) -> Text:
    from rich.text import Text

    return Text("yes", style="green") if part.is_complete else Text("no", style="yellow")


def _packages(part: Part) -> Text:
    from rich.text import Text

    text = Text()
    for k, package in enumerate(part.packages):
        text.append(", " if k else "")
        if package.is_there:
            text.append(f"{package.name} {package.found}")
        else:
            text.append(f"{package.name} {package.found or 'missing'}", style="yellow")
            text.append(f" (needs {package.needed})" if package.found else "", style="yellow")
    if not part.is_complete:
        text.append(f"\n{part.install}")
    return text
