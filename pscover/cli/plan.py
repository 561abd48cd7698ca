"""`pscover plan`: from the labels of a scene to grasps in the order of execution, with a picture."""

from __future__ import annotations

import importlib.util
import time as clock
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pscover.cli.fail import Exit, say
from pscover.cli.options import FILE, backend_option, formulation_option, json_option, parameter_option, point, quiet_option

if TYPE_CHECKING:
    from pscover.grasping.conflicts import Conflicts
    from pscover.planning import Plan
    from pscover.verify import Verification

PICTURES = (".png", ".svg", ".pdf")
PAPER_SCALE = 4.7
"""Pixels per cm at which the gripper's sizes in pixels are the paper's."""


@click.command("plan", short_help="Plan the grasps that clear a scene, and draw them.")
@click.argument("scene", type=FILE)
@click.option("--photo", type=FILE, help="Drawn under the plan.  [default: table.jpg or .png beside table.labels.png]")
@backend_option
@formulation_option
@parameter_option("--set", "parameters", "formulation")
@click.option("--time", "seconds", type=float, default=10.0, show_default=True, metavar="SECONDS", help="Deadline.")
@click.option("--seed", type=int, default=0, show_default=True, help="Of everything random.")
@click.option(
    "--pixels-per-cm", type=float, default=PAPER_SCALE, show_default=True, help="Scale; the gripper is drawn to it."
)
@click.option("--basket", type=point, metavar="X,Y", help="In pixels; may lie outside.  [default: middle of the right edge]")
@click.option("--required", type=float, default=0.7, show_default=True, help="Probability to remove each garment.")
@click.option("--points", type=int, default=5, show_default=True, help="Candidate points in each part.")
@click.option("--orientations", type=int, default=6, show_default=True, help="Angles at each point.")
@click.option(
    "--conflicts",
    type=click.Choice(("partition", "ellipse", "distance")),
    default="partition",
    show_default=True,
    help="Which grasps exclude each other.",
)
@click.option("--output", "-o", type=FILE, metavar="FILE", help="Write the plan to a .json file.")
@click.option("--figure", type=FILE, metavar="FILE", help="Picture.  [default: SCENE.plan.png in the current folder]")
@click.option("--no-figure", is_flag=True, help="Draw no picture.")
@click.option("--save-instance", "instance_file", type=FILE, metavar="FILE", help="Write the instance (.json, .npz).")
@json_option
@quiet_option
def command(
    scene: Path,
    photo: Path | None,
    backend: str,
    formulation: str,
    parameters: tuple[tuple[str, str], ...],
    seconds: float,
    seed: int,
    pixels_per_cm: float,
    basket: tuple[float, float] | None,
    required: float,
    points: int,
    orientations: int,
    conflicts: str,
    output: Path | None,
    figure: Path | None,
    no_figure: bool,
    instance_file: Path | None,
    as_json: bool,
    quiet: bool,
) -> Exit:
    """Plan the grasps that clear SCENE, a PNG of labels: 0 is the surface, each other value a garment.

    Prints the grasps in the order of execution (x and y in pixels from the top left, the angle of the jaw in degrees from
    the x axis towards the y axis, clockwise as seen) and how surely each garment is removed, and draws a picture. Exit
    code 0 if every garment is removed as surely as required; else the plan that comes closest is shown, and the code is 1.

    \b
    Examples:
      pscover generate garments --count 12 -o table.png && pscover plan table.png
      pscover plan table.labels.png --basket 470,141 -o plan.json
    """
    from pscover import isolate, registry
    from pscover.cli.live import watching
    from pscover.cli.output import require_distinct, require_writable, wrote
    from pscover.grasping.ellipse import Ellipse
    from pscover.grasping.sampling import Sampling
    from pscover.io import save_instance
    from pscover.plan_document import save_plan
    from pscover.planning import plan
    from pscover.result import Settings
    from pscover.scene import Scene
    from pscover.verify import verify

    Settings(time=seconds, seed=seed)
    engine, form = registry.backend(backend), registry.formulation(formulation, dict(parameters))
    picture = _picture(scene, figure, no_figure=no_figure, quiet=quiet)
    shown = photo or _sibling(scene)
    inputs = [path for path in (scene, shown) if path is not None]
    require_distinct(output, picture, instance_file)
    require_writable(output, inputs, suffixes=(".json",))
    require_writable(picture, inputs, suffixes=PICTURES)
    require_writable(instance_file, inputs, suffixes=(".json", ".npz"))
    # The engine's process starts while the image is read.
    isolate.warm_up(engine)
    there = Scene.read(scene, photo=shown, pixels_per_cm=pixels_per_cm, basket=basket)
    scale = pixels_per_cm / PAPER_SCALE
    gripper = Ellipse(major=40.0 * scale, minor=12.0 * scale, half=100.0 * scale**2)
    sampling = Sampling(points=points, orientations=orientations, reach=20.0 * scale)
    with watching(f"{engine.name} on {scene.name}", quiet=quiet) as line:
        found = plan(
            there,
            sampling=sampling,
            predictor=gripper,
            conflicts=_rule(conflicts, scale),
            required=required,
            backend=engine,
            formulation=form,
            time=seconds,
            seed=seed,
            observe=line,
        )
    verification = verify(found.instance, found.result)
    drawing = 0.0
    try:
        if output is not None:
            save_plan(found, output)
        if instance_file is not None:
            save_instance(found.instance, instance_file)
        if picture is not None:
            from pscover.figures.plan import save_plan_figure

            began = clock.monotonic()
            save_plan_figure(found, picture)
            drawing = clock.monotonic() - began
    finally:
        _print(found, verification, picture, drawing, as_json=as_json)
    if not quiet:
        for path, what in ((output, "the plan"), (instance_file, "the instance"), (picture, "the picture")):
            if path is not None:
                wrote(path, what)
    return _code(found, verification)


def _picture(scene: Path, figure: Path | None, *, no_figure: bool, quiet: bool) -> Path | None:
    """Where the picture goes, or None; it can be done without only if it was not asked for."""
    from pscover.errors import MissingDependency

    if no_figure:
        if figure is not None:
            raise click.UsageError("--figure and --no-figure exclude each other")
        return None
    if importlib.util.find_spec("matplotlib") is None:
        missing = MissingDependency.for_extra("the picture of a plan", ["matplotlib"], "figures")
        if figure is not None:
            raise missing
        if not quiet:
            say(f"note: no picture: {missing}")
        return None
    return figure or Path(f"{scene.name.removesuffix('.png').removesuffix('.labels')}.plan.png")


def _sibling(scene: Path) -> Path | None:
    """The photo beside a file of labels: x.jpg, x.jpeg or x.png beside x.labels.png."""
    stem = scene.name.removesuffix(".labels.png")
    if stem == scene.name:
        return None
    beside = (scene.with_name(stem + ending) for ending in (".jpg", ".jpeg", ".png"))
    return next((path for path in beside if path.is_file()), None)


def _rule(name: str, scale: float) -> str | Conflicts:
    from pscover.grasping.conflict_distance import CloserThan

    return CloserThan(pixels=40.0 * scale) if name == "distance" else name


def _code(found: Plan, verification: Verification) -> Exit:
    from pscover.cli.solve import code

    known = code(found.result, verification)
    return Exit.NO_PLAN if known is Exit.VERIFIED and found.unmet else known


def _print(found: Plan, verification: Verification, picture: Path | None, drawing: float, *, as_json: bool) -> None:
    from pscover.cli.output import show, show_document

    if as_json:
        import msgspec

        from pscover.cli.documents import verification_document
        from pscover.plan_document import document

        content: dict[str, Any] = {
            "plan": msgspec.to_builtins(document(found)),
            "verification": verification_document(verification),
            "figure": None if picture is None else str(picture),
        }
        show_document(content)
        return
    from pscover.cli.plan_tables import garment_table, grasp_table, plan_facts, plan_headline

    show(plan_headline(found))
    if found.grasps:
        show("", grasp_table(found))
    if found.scene.garments:
        show("", garment_table(found))
    show("", plan_facts(found, verification, picture, drawing))
