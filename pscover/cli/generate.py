"""`pscover generate`: scenes and instances made to order, reproducible from their seed."""

from __future__ import annotations

from pathlib import Path

import click

from pscover.cli.fail import Exit
from pscover.cli.options import FILE, quiet_option, whole_numbers

PNG = ".png"


@click.group("generate", short_help="Make random scenes of garments, or random instances.")
def command() -> None:
    """Make scenes or instances to order; the same options and seed give the same file."""


@command.command("garments")
@click.option("--count", type=int, default=35, show_default=True, help="How many garments.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of everything random.")
@click.option("--layout", type=click.Choice(("apart", "piled")), default="apart", show_default=True, help="How they lie.")
@click.option(
    "--groups",
    type=whole_numbers,
    metavar="N,N,...",
    default=(),
    help="Sizes of groups of overlapping garments; with layout apart.",
)
@click.option("--width", type=int, default=470, show_default=True, help="Of the image in pixels.")
@click.option("--height", type=int, default=282, show_default=True, help="Of the image in pixels.")
@click.option(
    "--required", type=float, default=0.7, show_default=True, help="In an instance: the requirement of each garment."
)
@click.option("--output", "-o", type=FILE, required=True, metavar="FILE", help=".png: the scene; else: its instance.")
@click.option("--photo", type=FILE, metavar="FILE", help="Also paint the scene as a camera might see it: .png or .jpg.")
@quiet_option
def garments_command(
    count: int,
    seed: int,
    layout: str,
    groups: tuple[int, ...],
    width: int,
    height: int,
    required: float,
    output: Path,
    photo: Path | None,
    quiet: bool,
) -> Exit:
    """Make a random scene of garments.

    A .png holds the labels of the garments, 0 for the surface; .json and .npz hold the instance of its candidate grasps.
    --photo paints what lies there: coloured cloth with folds on a grey table, for perception to find.

    \b
    Examples:
      pscover generate garments --count 12 --seed 1 -o table.png --photo table.jpg
      pscover generate garments --count 20 --groups 4,3 -o table.json
    """
    from dataclasses import replace
    from typing import cast

    from pscover.cli.output import require_distinct, require_writable, wrote
    from pscover.encoding import encode_labels, encode_photo
    from pscover.files import write_bytes
    from pscover.generate.garments import Layout, garments

    require_distinct(output, photo)
    require_writable(output, suffixes=(PNG, ".json", ".npz"))
    require_writable(photo, suffixes=(PNG, ".jpg", ".jpeg"))
    scene = garments(count, seed, size=(height, width), layout=cast(Layout, layout), groups=groups)
    if output.suffix.lower() == PNG:
        write_bytes(output, encode_labels(scene.labels))
        what = f"the labels of {scene.garments} garments (dark in a viewer; `pscover plan` draws them)"
    else:
        from pscover.grasping.candidates import candidates
        from pscover.io import save_instance

        made = candidates(scene, required=required, seed=seed)
        name = f"garments{count}-{layout}-s{seed}"
        save_instance(replace(made, meta=replace(made.meta, name=name)), output)
        what = f"the instance of {scene.garments} garments"
    if not quiet:
        wrote(output, what)
    if photo is not None:
        from pscover.generate.paint import paint

        write_bytes(photo, encode_photo(paint(scene, seed), photo.suffix.lower(), "a painted photo"))
        if not quiet:
            wrote(photo, "the photo")
    return Exit.VERIFIED


@command.command("psc")
@click.option("--elements", type=int, help="How many elements.")
@click.option("--candidates", type=int, help="How many candidates.")
@click.option("--on", "incidence", type=FILE, metavar="INSTANCE", help="Use its incidence and costs instead of random ones.")
@click.option("--covers", type=int, default=4, show_default=True, help="How many elements each candidate covers.")
@click.option("--low", type=float, default=0.3, show_default=True, help="Lowest probability.")
@click.option("--high", type=float, default=0.95, show_default=True, help="Highest probability.")
@click.option("--required", type=float, default=0.95, show_default=True, help="Requirement, less where supply is short.")
@click.option("--clique-size", type=int, help="How many candidates exclude each other; no conflicts by default.")
@click.option("--cheapest", type=int, default=1, show_default=True, help="Lowest cost, a whole number.")
@click.option("--dearest", type=int, default=1, show_default=True, help="Highest cost, a whole number.")
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Of everything random.")
@click.option("--output", "-o", type=FILE, required=True, metavar="FILE", help="Of the instance: .json or .npz.")
@quiet_option
def psc_command(
    elements: int | None,
    candidates: int | None,
    incidence: Path | None,
    covers: int,
    low: float,
    high: float,
    required: float,
    clique_size: int | None,
    cheapest: int,
    dearest: int,
    seed: int,
    output: Path,
    quiet: bool,
) -> Exit:
    """Make a random instance: of a size, or on the incidence of another instance.

    \b
    Examples:
      pscover generate psc --elements 50 --candidates 400 -o random.json
      pscover generate psc --on scp41.txt --required 0.9 -o scp41-psc.json
    """
    from pscover.cli.output import require_writable, wrote
    from pscover.generate.psc import psc_on_incidence, random_psc
    from pscover.io import load_instance, save_instance

    require_writable(output, [] if incidence is None else [incidence], suffixes=(".json", ".npz"))
    if incidence is not None:
        if elements is not None or candidates is not None:
            raise click.UsageError("--on gives the size; leave --elements and --candidates out")
        base = load_instance(incidence)
        made = psc_on_incidence(base, low=low, high=high, required=required, clique_size=clique_size, seed=seed)
    elif elements is None or candidates is None:
        raise click.UsageError("expected --elements and --candidates, or --on INSTANCE")
    else:
        made = random_psc(
            elements,
            candidates,
            covers=covers,
            low=low,
            high=high,
            required=required,
            clique_size=clique_size,
            cheapest=cheapest,
            dearest=dearest,
            seed=seed,
        )
    save_instance(made, output)
    if not quiet:
        wrote(output, f"the instance {made.meta.name} ({made.elements} elements, {made.candidates} candidates)")
    return Exit.VERIFIED
