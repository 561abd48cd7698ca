"""`pscover plan`: from a photo, labels or annotations to grasps in the order of execution, with pictures."""

from __future__ import annotations

import importlib.util
import time as clock
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pscover.cli.fail import Exit, say
from pscover.cli.look import Corners, Eyes, looking, notes, stem_of
from pscover.cli.options import (
    FILE,
    formulation_option,
    json_option,
    parameter_option,
    planning_backend_option,
    quiet_option,
)

if TYPE_CHECKING:
    from pscover.backend import Backend
    from pscover.cli.live import Line
    from pscover.formulation import Formulation
    from pscover.grasping.conflicts import Conflicts
    from pscover.grasping.pool import Candidates
    from pscover.planning import Plan
    from pscover.seen import Seen
    from pscover.verify import Verification

PICTURES = (".png", ".svg", ".pdf")
PAGES = (".html", ".htm")


@dataclass(frozen=True, slots=True, kw_only=True)
class Planner:
    """How to plan for a scene, apart from where it comes from."""

    engine: Backend
    form: Formulation
    seconds: float
    seed: int
    required: float
    points: int
    orientations: int
    candidates: Candidates
    conflicts: str

    def plan(self, seen: Seen, observe: Line) -> Plan:
        """The plan, with the paper's gripper at the scene's scale."""
        from pscover.planning import paper_gripper, plan

        scale = seen.scene.pixels_per_cm
        sampling, gripper = paper_gripper(scale, points=self.points, orientations=self.orientations)
        return plan(
            seen,
            sampling=sampling,
            predictor=gripper,
            candidates=self.candidates,
            conflicts=_rule(self.conflicts, gripper.major),
            required=self.required,
            backend=self.engine,
            formulation=self.form,
            time=self.seconds,
            seed=self.seed,
            observe=observe,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Outputs:
    """Where the parts of a plan go; None is nowhere."""

    plan: Path | None = None
    picture: Path | None = None
    instance: Path | None = None
    page: Path | None = None

    def check(self, inputs: list[Path]) -> None:
        """Raise unless all can be written."""
        from pscover.cli.output import require_distinct, require_writable

        require_distinct(self.plan, self.picture, self.instance, self.page)
        require_writable(self.plan, inputs, suffixes=(".json",))
        require_writable(self.picture, inputs, suffixes=PICTURES)
        require_writable(self.instance, inputs, suffixes=(".json", ".npz"))
        require_writable(self.page, inputs, suffixes=PAGES)

    def write(self, found: Plan, verification: Verification) -> float:
        """Write them, and return the seconds that drawing took."""
        if self.plan is not None:
            from pscover.plan_document import save_plan

            save_plan(found, self.plan)
        if self.instance is not None:
            from pscover.io import save_instance
            from pscover.plan_document import instance_of_photo

            save_instance(instance_of_photo(found), self.instance)
        began = clock.monotonic()
        if self.page is not None:
            from pscover.report import save_report

            save_report(found, self.page, verification)
        if self.picture is not None:
            from pscover.figures.plan import save_plan_figure

            save_plan_figure(found, self.picture)
        return clock.monotonic() - began

    def announce(self) -> None:
        """Say where everything went."""
        from pscover.cli.output import wrote

        parts = ((self.plan, "the plan"), (self.instance, "the instance"), (self.picture, "the picture"))
        for path, what in (*parts, (self.page, "the report")):
            if path is not None:
                wrote(path, what)


@click.command("plan", cls=Corners, short_help="Plan the grasps that clear what a photo shows, and draw them.")
@click.argument("scene", metavar="PHOTO", type=FILE)
@looking
@planning_backend_option
@formulation_option
@parameter_option("--set", "parameters", "formulation")
@click.option(
    "--time", "seconds", type=float, default=10.0, show_default=True, metavar="SECONDS", help="Deadline of the plan."
)
@click.option("--seed", type=int, default=0, show_default=True, help="Of everything random.")
@click.option("--required", type=float, default=0.7, show_default=True, help="Probability to remove each garment.")
@click.option("--points", type=int, default=5, show_default=True, help="Candidate points in each part.")
@click.option("--orientations", type=int, default=6, show_default=True, help="Angles at each point.")
@click.option(
    "--candidates",
    type=click.Choice(("sampled", "all")),
    default="sampled",
    show_default=True,
    help="Plan from points drawn in each part, or from every garment pixel, so that the bound holds over all of them.",
)
@click.option(
    "--conflicts",
    type=click.Choice(("partition", "ellipse", "distance")),
    default="partition",
    show_default=True,
    help="Which grasps exclude each other.",
)
@click.option("--output", "-o", type=FILE, metavar="FILE", help="Write the plan to a .json file; for a folder, a folder.")
@click.option("--figure", type=FILE, metavar="FILE", help="Picture.  [default: PHOTO.plan.png in the current folder]")
@click.option("--no-figure", is_flag=True, help="Draw no picture.")
@click.option("--html", "page", type=FILE, metavar="FILE", help="Write a report to open in a browser: one .html file.")
@click.option("--save-instance", "instance_file", type=FILE, metavar="FILE", help="Write the instance (.json, .npz).")
@json_option
@quiet_option
def command(
    scene: Path,
    eyes: Eyes,
    backend: str | None,
    formulation: str,
    parameters: tuple[tuple[str, str], ...],
    seconds: float,
    seed: int,
    required: float,
    points: int,
    orientations: int,
    candidates: Candidates,
    conflicts: str,
    output: Path | None,
    figure: Path | None,
    no_figure: bool,
    page: Path | None,
    instance_file: Path | None,
    as_json: bool,
    quiet: bool,
) -> Exit:
    """Plan the grasps that clear what PHOTO shows: a JPEG or PNG, a PNG of labels (0 is the surface, each other value a
    garment), or annotations (records of Segment Anything, COCO, LabelMe, NumPy). The content says which.

    Prints the grasps in the order of execution (x and y in pixels of the photo from the top left, the angle of the jaw in
    degrees from the x axis towards the y axis, clockwise as seen) and how surely each garment is removed, and draws a
    picture. Exit code 0 if every garment is removed as surely as required; else the plan that comes closest is shown, and
    the code is 1.

    Of a folder, every photo is planned; a bad one does not stop the rest. Plans, pictures and reports go to the folder -o,
    and the code is 2 if a photo could not be read, else 1 if a plan falls short.

    \b
    Examples:
      pscover plan photo.jpg --html report.html
      pscover plan photo.jpg --roi 40,30 600,30 600,450 40,450 --px-per-cm 6.1
      pscover plan photo.jpg --depth depth.png --depth-scale 0.001
      pscover plan photo.jpg --candidates all --orientations 12
      pscover plan sam_records.json --photo photo.jpg -o plan.json
      pscover plan photos/ -o plans/
    """
    from pscover import isolate, registry
    from pscover.cli.live import watching
    from pscover.inputs import Kind
    from pscover.result import Settings
    from pscover.verify import verify

    Settings(time=seconds, seed=seed)
    planner = Planner(
        engine=registry.backend(backend or registry.planning_backend()),
        form=registry.formulation(formulation, dict(parameters)),
        seconds=seconds,
        seed=seed,
        required=required,
        points=points,
        orientations=orientations,
        candidates=candidates,
        conflicts=conflicts,
    )
    if no_figure and figure is not None:
        raise click.UsageError("--figure and --no-figure exclude each other")
    kind = eyes.kind_of(scene)
    if kind is Kind.FOLDER:
        from pscover.cli.plan_folder import plan_folder

        if figure or page or instance_file:
            raise click.UsageError("--figure, --html and --save-instance are for one photo; of a folder, -o DIR gets all")
        drawn = _picture(scene, figure, no_figure=no_figure, quiet=quiet) is not None
        return plan_folder(scene, output, eyes, planner, drawn=drawn, as_json=as_json, quiet=quiet)
    picture = _picture(scene, figure, no_figure=no_figure, quiet=quiet)
    outputs = Outputs(plan=output, picture=picture, instance=instance_file, page=page)
    outputs.check(eyes.inputs(scene))
    # The engine's process starts while the image is looked at.
    isolate.warm_up(planner.engine)
    with watching(f"looking at {scene.name}", quiet=quiet) as line:
        seen = eyes.read(scene)
        line.restart(f"{planner.engine.name} on {scene.name}")
        found = planner.plan(seen, line)
    for note in () if quiet else notes(seen):
        say(note)
    verification, drawing = verify(found.instance, found.result), 0.0
    try:
        drawing = outputs.write(found, verification)
    finally:
        _print(found, verification, outputs, drawing, as_json=as_json)
    if not quiet:
        outputs.announce()
    return plan_code(found, verification)


def _picture(scene: Path, figure: Path | None, *, no_figure: bool, quiet: bool) -> Path | None:
    """Where the picture goes, or None; it can be done without only if it was not asked for."""
    from pscover.errors import MissingDependency

    if no_figure:
        return None
    if importlib.util.find_spec("matplotlib") is None:
        missing = MissingDependency.for_extra("the picture of a plan", ["matplotlib"], "figures")
        if figure is not None:
            raise missing
        if not quiet:
            say(f"note: no picture: {missing}")
        return None
    return figure or Path(f"{stem_of(scene)}.plan.png")


def _rule(name: str, pixels: float) -> str | Conflicts:
    from pscover.grasping.conflict_distance import CloserThan

    return CloserThan(pixels=pixels) if name == "distance" else name


def plan_code(found: Plan, verification: Verification) -> Exit:
    """The exit code of a plan and its check."""
    from pscover.cli.solve import code

    known = code(found.result, verification)
    return Exit.NO_PLAN if known is Exit.VERIFIED and found.unmet else known


def _print(found: Plan, verification: Verification, outputs: Outputs, drawing: float, *, as_json: bool) -> None:
    from pscover.cli.output import show, show_document

    if as_json:
        import msgspec

        from pscover.cli.documents import verification_document
        from pscover.plan_document import document

        content: dict[str, Any] = {
            "plan": msgspec.to_builtins(document(found)),
            "verification": verification_document(verification),
            "figure": None if outputs.picture is None else str(outputs.picture),
            "html": None if outputs.page is None else str(outputs.page),
        }
        show_document(content)
        return
    from pscover.cli.plan_tables import garment_table, grasp_table, plan_facts, plan_headline

    show(plan_headline(found))
    if found.grasps:
        show("", grasp_table(found))
    if found.scene.garments:
        show("", garment_table(found))
    show("", plan_facts(found, verification, outputs.picture, outputs.page, drawing))
