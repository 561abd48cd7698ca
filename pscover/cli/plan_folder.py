"""`pscover plan` for a folder: plan, picture and report of every photo, and a table over all."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pscover.cli.fail import Exit

if TYPE_CHECKING:
    from rich.table import Table

    from pscover.cli.folder import Outcome
    from pscover.cli.look import Eyes
    from pscover.cli.plan import Planner
    from pscover.planning import Plan


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A photo's plan in figures: the plan itself, with its candidates, would fill the memory."""

    garments: int
    grasps: int
    status: str
    unmet: int
    expected: float
    looking: float
    planning: float
    code: Exit
    plan: Path

    @classmethod
    def of(cls, found: Plan, code: Exit, path: Path) -> Row:
        """The figures of a plan that was written to `path`."""
        return cls(
            garments=found.scene.garments,
            grasps=len(found.grasps),
            status=str(found.status),
            unmet=len(found.unmet),
            expected=found.expected_removed,
            looking=found.seen.seconds,
            planning=found.seconds.candidates + found.seconds.solve,
            code=code,
            plan=path,
        )


def plan_folder(
    folder: Path, output: Path | None, eyes: Eyes, planner: Planner, *, drawn: bool, as_json: bool, quiet: bool
) -> Exit:
    """Plan every photo of a folder, and return the exit code for all of them."""
    from pscover import isolate
    from pscover.cli.fail import say
    from pscover.cli.folder import each, output_folder, photos_in, stems
    from pscover.cli.live import Line
    from pscover.cli.output import show, show_document
    from pscover.cli.plan import Outputs, plan_code
    from pscover.verify import verify

    paths = photos_in(folder)
    target, names = output_folder(output, folder), stems(paths)
    isolate.warm_up(planner.engine)

    def work(path: Path) -> Row:
        named = target / names[path]
        outputs = Outputs(
            plan=named.with_name(f"{named.name}.plan.json"),
            picture=named.with_name(f"{named.name}.plan.png") if drawn else None,
            page=named.with_name(f"{named.name}.html"),
        )
        outputs.check(eyes.inputs(path))
        found = planner.plan(eyes.read(path), Line(path.name))
        verification = verify(found.instance, found.result)
        outputs.write(found, verification)
        assert outputs.plan is not None
        return Row.of(found, plan_code(found, verification), outputs.plan)

    outcome = each(paths, work, verb="planning for", quiet=quiet)
    if as_json:
        show_document(_document(outcome))
    else:
        show(_table(outcome))
    outcome.report()
    if outcome.done and not quiet:
        say(f"wrote plans{', pictures' if drawn else ''} and reports of {len(outcome.done)} photos to {target}")
    return outcome.code(max((row.code for _, row in outcome.done), default=Exit.VERIFIED))


def _document(outcome: Outcome[Row]) -> dict[str, object]:
    """The figures of all photos; times in seconds."""
    fields = ("garments", "grasps", "status", "unmet", "expected", "looking", "planning", "plan")
    return {
        "photos": [{"photo": path, **{name: getattr(row, name) for name in fields}} for path, row in outcome.done],
        "failed": [{"photo": failure.path, "error": failure.message} for failure in outcome.failures],
        "interrupted": outcome.interrupted,
    }


def _table(outcome: Outcome[Row]) -> Table:
    from rich.text import Text

    from pscover.cli.tables import grid
    from pscover.cli.words import NOTHING

    table = grid(
        ("photo", "fill"), ("garments", "right"), ("grasps", "right"), ("expected", "right"), ("status", "left"),
        ("seconds", "right"),
    )  # fmt: skip
    for path, row in outcome.done:
        short = f" ({row.unmet} short)" if row.unmet else ""
        status = Text(row.status + short, style="" if row.code is Exit.VERIFIED else "bold yellow")
        figures = (str(row.garments), str(row.grasps), f"{row.expected:.1f}")
        table.add_row(path.name, *figures, status, f"{row.looking + row.planning:.2f}")
    for failure in outcome.failures:
        table.add_row(failure.path.name, *[NOTHING] * 3, Text("failed", style="bold red"), NOTHING)
    return table
