"""`pscover convert`: from one file format to another."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from pscover.cli.fail import Exit
from pscover.cli.options import FILE, formulation_option, parameter_option, quiet_option

if TYPE_CHECKING:
    from pscover.instance import Instance

MPS = ".mps"


@click.command("convert", short_help="Convert an instance between formats, or write a model as MPS.")
@click.argument("source", metavar="IN", type=FILE)
@click.argument("target", metavar="OUT", type=FILE)
@click.option(
    "--from",
    "layout",
    type=click.Choice(("scp", "rail", "sts")),
    help="How the numbers of an OR-Library file are arranged, where its ending and content leave it open.",
)
@formulation_option
@parameter_option("--set", "parameters", "formulation")
@quiet_option
def command(
    source: Path,
    target: Path,
    layout: str | None,
    formulation: str,
    parameters: tuple[tuple[str, str], ...],
    quiet: bool,
) -> Exit:
    """Read the instance IN and write it to OUT; the endings of the names say in which formats.

    .json, .npz, .scp, .rail, .txt hold instances, .sts is read only; .mps is written only: the model of a formulation.

    \b
    Examples:
      pscover convert scp41.txt scp41.json
      pscover convert table.json table.mps --formulation pairwise
    """
    from pscover import registry
    from pscover.cli.output import require_writable, wrote
    from pscover.io import save_instance, suffixes, write_mps

    require_writable(target, [source], suffixes=(*suffixes(), MPS))
    if target.suffix.lower() == MPS:
        form = registry.formulation(formulation, dict(parameters))
        write_mps(form.build(_load(source, layout)), target)
        what = f"the {form.name} model"
    else:
        save_instance(_load(source, layout), target)
        what = "the instance"
    if not quiet:
        wrote(target, what)
    return Exit.VERIFIED


def _load(path: Path, layout: str | None) -> Instance:
    if layout is None:
        from pscover.io import load_instance

        return load_instance(path)
    from pscover.io.orlib import TextFormat, load

    return load(path, TextFormat(layout))
