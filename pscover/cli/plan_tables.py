"""A plan of grasps as tables."""

from __future__ import annotations

import math
from pathlib import Path

from rich.table import Table
from rich.text import Text

from pscover import registry
from pscover.cli.depth_files import HEIGHTS
from pscover.cli.tables import bounds, facts, grid, verified
from pscover.cli.words import NOTHING, count, listed, number, spread
from pscover.goal import Cover
from pscover.planning import Plan
from pscover.result import Status, Stop
from pscover.verify import Verification


def plan_headline(plan: Plan) -> Text:
    """What the plan does and what is proven of it."""
    garments, grasps = plan.scene.garments, count(len(plan.grasps), "grasp")
    if garments == 0:
        return Text("nothing lies on the surface: no grasp is needed")
    if not plan.grasps:
        return Text(f"no plan for {count(garments, 'garment')}: {_proof(plan)}", style="bold red")
    each = f"{'it' if garments == 1 else 'each'} with probability >= {spread(plan.instance.required)}"
    if not plan.unmet:
        done = f"{grasps} {'removes' if len(plan.grasps) == 1 else 'remove'} {count(garments, 'garment')}, {each}"
        return Text(done, style="bold").append(f"; {_proof(plan)}", style="default not bold")
    short = f"{grasps} for {count(garments, 'garment')}, but {len(plan.unmet)} less surely removed than required"
    return Text(short, style="bold yellow").append(f"; {_proof(plan)}", style="default not bold")


def _proof(plan: Plan) -> str:
    status = plan.status
    sampled = plan.scope.candidates == "sampled"
    scope = f"these {count(plan.instance.candidates, 'candidate')}" if sampled else str(plan.scope)
    aim = registry.formulation((plan.strict or plan.result).formulation).goal
    if not isinstance(aim, Cover):
        return f"{status} for the goal of formulation {plan.result.formulation}"
    if status is Status.OPTIMAL:
        return f"proven optimal: no plan from {scope} needs fewer"
    if status is Status.INFEASIBLE:
        closest = "this one comes closest" if sampled else "this one comes as close as was found"
        return f"proven: no plan from {scope} meets every requirement; {closest}"
    why = {Stop.TIME: "time limit", Stop.INTERRUPT: "interrupted"}.get(plan.result.stop, "")
    ended = f" ({why})" if why else ""
    if status is Status.UNKNOWN:
        return f"a plan that meets every requirement was neither found nor ruled out{ended}"
    if not math.isfinite(plan.bound):
        return f"not proven optimal{ended}"
    return f"not proven optimal{ended}: at least {number(plan.bound)} are needed" + ("" if sampled else f" from {scope}")


def grasp_table(plan: Plan) -> Table:
    """The grasps in the order of execution."""
    table = grid(
        ("#", "right"), ("x px", "right"), ("y px", "right"), ("angle", "right"), ("removes, with probability", "fill")
    )
    for k, grasp in enumerate(plan.grasps, start=1):
        removes = ", ".join(f"{removal.name} {removal.probability:.2f}" for removal in grasp.removes)
        table.add_row(str(k), f"{grasp.x:.0f}", f"{grasp.y:.0f}", f"{math.degrees(grasp.theta):.0f}°", removes)
    return table


def garment_table(plan: Plan) -> Table:
    """How surely each garment is removed, and by which grasps; with depth, how high it lies."""
    heights = plan.seen.garment_heights
    table = grid(
        ("garment", "fill"),
        ("required", "right"),
        ("removed", "right"),
        *(HEIGHTS if heights else ()),
        ("by grasps", "fill"),
    )
    by: dict[int, list[str]] = {}
    for k, grasp in enumerate(plan.grasps, start=1):
        for removal in grasp.removes:
            by.setdefault(removal.garment, []).append(str(k))
    unmet = set(plan.unmet)
    for j, name in enumerate(plan.scene.names):
        removed = Text(f"{plan.coverage[j]:.3f}", style="bold yellow" if j in unmet else "")
        grasps = listed(by[j], 12) if j in by else NOTHING
        high = [f"{100 * value:.1f}" for value in (heights[j].top, heights[j].mean)] if heights else []
        required = number(float(plan.instance.required[j]))
        table.add_row(name, required, removed, *high, grasps + (" (short)" if j in unmet else ""))
    return table


def plan_facts(
    plan: Plan, verification: Verification, picture: Path | None, page: Path | None = None, drawing: float = 0.0
) -> Table:
    """What was looked at, expectation, times, the check, and where the pictures went."""
    rows: list[tuple[str, str | Text]] = [
        ("input", plan.seen.origin),
        *([("depth", plan.seen.depth_origin)] if plan.seen.heights is not None else []),
        ("expected", f"{plan.expected_removed:.1f} of {count(plan.scene.garments, 'garment')} removed"),
        *_scope(plan, verification),
        ("time", stage_times(plan, drawing)),
        *verified(plan.result, verification),
    ]
    if picture is not None:
        rows.append(("picture", str(picture)))
    if page is not None:
        rows.append(("report", str(page)))
    return facts(rows)


def _scope(plan: Plan, verification: Verification) -> list[tuple[str, str | Text]]:
    """The bound, and over which poses it holds."""
    if plan.scope.candidates == "sampled":
        return [("bound", bounds(plan.result, verification))] if math.isfinite(plan.result.bound) else []
    searched = f"{count(plan.instance.candidates, 'pose')} of {plan.scope.poses:,} searched"
    if not math.isfinite(plan.bound):
        return [("candidates", f"all poses of the grid: {searched}")]
    return [("bound", f"{number(plan.bound)}, over {plan.scope}; {searched}, the others ruled out below it")]


def stage_times(plan: Plan, drawing: float = 0.0) -> str:
    """Wall seconds of every stage, in order, and of all together."""
    stages = [(stage.name, stage.seconds) for stage in plan.seen.stages]
    stages += [("candidates", plan.seconds.candidates), ("solve", plan.seconds.solve)]
    stages += [("picture", drawing)] if drawing else []
    total = sum(seconds for _, seconds in stages)
    return f"{total:.2f} s: {', '.join(f'{name} {seconds:.2f}' for name, seconds in stages)}"
