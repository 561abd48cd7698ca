"""`pscover models`: where weights are looked for, whether they are what they should be, and making ONNX files of them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pscover.cli.fail import Exit
from pscover.cli.options import FILE, json_option, quiet_option

if TYPE_CHECKING:
    from pscover.perception.models import Weights


@click.group("models", short_help="Weights of SAM-like segmenters: where they are, whether they are right.")
def command() -> None:
    """Weights of segmenters of the SAM family. They are neither shipped nor downloaded."""


@command.command("where", short_help="List the weights, where each was found, and where it comes from.")
@json_option
def where(as_json: bool) -> Exit:
    """List the weights that pscover knows, where each was found, and where it comes from. Contents are not looked at."""
    from pscover.perception.models import CATALOGUE, find, folders

    rows: list[dict[str, Any]] = [
        {"file": weights.file, "found": find(weights), "sha256": weights.digests, "origin": weights.origin}
        for weights in CATALOGUE
    ]
    if as_json:
        from pscover.cli.output import show_document

        show_document({"folders": folders(), "weights": rows})
        return Exit.VERIFIED
    from rich.text import Text

    from pscover.cli.output import show
    from pscover.cli.tables import facts, grid

    table = grid(("weights", "left"), ("found in", "fill"))
    for row in rows:
        place = Text("not found", style="yellow").append(f"; {row['origin']}", style="default")
        table.add_row(Text(row["file"], style="bold"), str(row["found"].parent) if row["found"] else place)
    show(table, "", facts([("looked for in", ", ".join(map(str, folders())))]))
    return Exit.VERIFIED


@command.command("check", short_help="Compare the digests of weights with those they must have.")
@click.argument("files", metavar="[FILE]...", type=FILE, nargs=-1)
@json_option
def check(files: tuple[Path, ...], as_json: bool) -> Exit:
    """Compare the SHA-256 digests of FILEs with those that pscover knows, or that SHA256SUMS beside them vouches for.

    Without FILE, all weights that are found. Exit code 2 if one is not right, or if there is none.
    """
    from pscover.errors import PscoverError
    from pscover.perception.models import CATALOGUE, digest, find, folders, vouched

    found = list(files) or [path for weights in CATALOGUE if (path := find(weights)) is not None]
    if not found:
        raise PscoverError(
            f"no weights found in {', '.join(map(str, folders()))}; `pscover models where` says what goes there"
        )
    rows = []
    for path in found:
        known = _digests(path, CATALOGUE)
        try:
            rows.append({"file": str(path), "right": True, "sha256": digest(vouched(path, known)), "problem": ""})
        except PscoverError as problem:
            rows.append({"file": str(path), "right": False, "sha256": None, "problem": str(problem)})
    if as_json:
        from pscover.cli.output import show_document

        show_document({"weights": rows})
    else:
        _show_checks(rows)
    return Exit.VERIFIED if all(row["right"] for row in rows) else Exit.BAD_INPUT


@command.command("export", short_help="Make the ONNX files of segmenter mobile-sam from mobile_sam.pt.")
@click.argument("checkpoint", type=FILE, default=Path("mobile_sam.pt"))
@click.option(
    "--output", "-o", type=FILE, default=Path("models"), show_default=True, metavar="DIR", help="Folder; made if need be."
)
@quiet_option
def export_(checkpoint: Path, output: Path, quiet: bool) -> Exit:
    """Make mobile_sam_encoder.onnx and mobile_sam_decoder.onnx from CHECKPOINT, the path of mobile_sam.pt or of a SAM of
    one's own. Without a path, mobile_sam.pt is taken from the current folder or where weights are looked for.

    Both are compared with the checkpoint's own answers before they are written, and entered into SHA256SUMS beside them.

    \b
    Examples:
      pscover models export ~/Downloads/mobile_sam.pt
      pscover plan photo.jpg --segmenter mobile-sam
    """
    from pscover.cli.live import watching
    from pscover.cli.output import show
    from pscover.cli.tables import facts
    from pscover.errors import PscoverError
    from pscover.perception.export import export
    from pscover.perception.models import MOBILE_SAM, locate

    if output.exists() and not output.is_dir():
        raise PscoverError(f"{output}: expected a folder for the files, got a file")
    with watching(f"exporting {checkpoint.name}", quiet=quiet):
        known = checkpoint == Path(MOBILE_SAM.file) and not checkpoint.exists()
        made = export(locate(MOBILE_SAM) if known else checkpoint, output)
    show(
        facts(
            [
                ("encoder", str(made.encoder)),
                ("decoder", str(made.decoder)),
                ("compared", f"logits differ from the checkpoint's by at most {made.difference:.2g}"),
            ]
        )
    )
    return Exit.VERIFIED


def _digests(path: Path, catalogue: tuple[Weights, ...]) -> tuple[str, ...]:
    """What a file of that name must have; under another name it may be any of the known ones."""
    own = tuple(digest for weights in catalogue if weights.file == path.name for digest in weights.digests)
    return own or tuple(digest for weights in catalogue for digest in weights.digests)


def _show_checks(rows: list[dict[str, Any]]) -> None:
    from rich.text import Text

    from pscover.cli.output import show
    from pscover.cli.tables import grid

    table = grid(("weights", "fill"), ("right", "left"), ("SHA-256, or what is wrong", "fill"))
    for row in rows:
        verdict = Text("yes", style="green") if row["right"] else Text("no", style="bold red")
        table.add_row(row["file"], verdict, row["sha256"] or row["problem"])
    show(table)
