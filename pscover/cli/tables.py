"""Results, checks and diagnoses as tables that can be read at 80 columns."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from pscover import registry
from pscover.cli.words import NOTHING, count, listed, number, percent, seconds
from pscover.errors import PscoverError
from pscover.formulation import Relation
from pscover.result import Result, Status, Stop
from pscover.verify import Verdict, Verification

if TYPE_CHECKING:
    from pscover.infeasibility import Diagnosis
    from pscover.instance import Instance

STYLES = {
    Status.OPTIMAL: "bold green",
    Status.FEASIBLE: "bold yellow",
    Status.INFEASIBLE: "bold red",
    Status.UNKNOWN: "bold red",
}
VERDICTS = {Verdict.PASSED: "green", Verdict.FAILED: "bold red", Verdict.UNCHECKED: "yellow"}
MOST_ROWS = 20
"""Longer lists are cut in tables; the JSON document has all."""
MOST_CANDIDATES = 100


def facts(rows: Iterable[tuple[str, str | Text]]) -> Table:
    """Labels on the left, what they say on the right."""
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0), pad_edge=False)
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    for label, content in rows:
        table.add_row(label, content)
    return table


def grid(*columns: tuple[str, str]) -> Table:
    """A table with a header; each column is its name and its side: "left", "right", or "fill" for one that may wrap."""
    table = Table(box=SIMPLE_HEAD, show_edge=False, header_style="bold", padding=(0, 1, 0, 0), pad_edge=False)
    for name, side in columns:
        table.add_column(name, justify="right" if side == "right" else "left", overflow="fold", no_wrap=side != "fill")
    return table


def headline(instance: Instance) -> Text:
    """The instance in one line."""
    name = instance.meta.name or "instance"
    size = f"{count(instance.elements, 'element')}, {count(instance.candidates, 'candidate')}"
    return Text.assemble((name, "bold"), f": {size}, {count(len(instance.conflicts), 'conflict clique')}")


def outcome(instance: Instance, result: Result, verification: Verification) -> Table:
    """What a solve found and how good it is."""
    rows: list[tuple[str, str | Text]] = [("status", status_line(result))]
    if result.chosen is not None:
        rows.append(("objective", ", ".join(number(value) for value in result.value)))
        rows.append(("bound", f"{bounds(result, verification)}, gap {percent(result.gap)}"))
        names = [instance.meta.candidate(int(i)) for i in result.chosen]
        rows.append(("plan", f"{len(names)} of {count(instance.candidates, 'candidate')}: {listed(names, MOST_CANDIDATES)}"))
        rows.append(("coverage", tightest(instance, result)))
    elif np.isfinite(result.bound):
        rows.append(("bound", bounds(result, verification)))
    timing = result.timing
    parts = f"build {timing.build:.2f}, engine {timing.engine:.2f}, check {timing.check:.2f}"
    rows.append(("time", f"{seconds(timing.total)} ({parts})"))
    if result.message:
        rows.append(("engine", f"{result.backend}: {result.message}"))
    return facts([*rows, *verified(result, verification)])


def bounds(result: Result, verification: Verification) -> str:
    """The engine's bound, and how much of it the certificate proves."""
    certified = verification.certified
    return number(result.bound) + ("" if certified is None else f", certified {number(float(certified))}")


def status_line(result: Result) -> Text:
    """The status, and in words what it means and why the search ended."""
    text = Text(str(result.status), style=STYLES[result.status])
    relation = _relation(result)
    is_exact = registry.lookup("backend", result.backend).exact
    reason = {
        Status.OPTIMAL: f"no plan is better by more than the gap of {percent(result.settings.gap)}"
        if result.settings.gap
        else "no plan is better",
        Status.FEASIBLE: "every requirement is met; a better plan may exist",
        Status.INFEASIBLE: "proven: no plan meets every requirement",
        Status.UNKNOWN: "no plan that meets every requirement was found, and none was ruled out",
    }[result.status]
    why = {
        Stop.TIME: f"ended by the time limit of {number(result.settings.time)} s",
        Stop.INTERRUPT: "interrupted; this is the best so far" if result.has_plan else "interrupted",
        Stop.OBSERVER: "stopped",
        Stop.FINISHED: "",
    }[result.stop]
    if not why and result.status in (Status.FEASIBLE, Status.UNKNOWN):
        if relation is Relation.RESTRICTION:
            why = f"formulation {result.formulation} leaves plans out, so it proves nothing"
        elif not is_exact:
            why = f"backend {result.backend} looks no further"
    text.append(f" - {reason}{f' ({why})' if why else ''}", style="default not bold")
    return text


def tightest(instance: Instance, result: Result) -> str:
    """The element with the least to spare."""
    if result.coverage is None or instance.elements == 0:
        return "no elements"
    spare = result.coverage - instance.required
    j = int(np.argmin(spare))
    missed = int((spare < -1e-9).sum())
    verdict = f"{count(missed, 'requirement')} missed" if missed else "every requirement met"
    closest = f"{number(float(result.coverage[j]))} (required {number(float(instance.required[j]))})"
    return f"{verdict}; least to spare: {element(instance, j)} with {closest}"


def element(instance: Instance, j: int) -> str:
    """The name of an element, or its number with the word."""
    return instance.meta.elements[j] if instance.meta.elements else f"element {j}"


def verified(result: Result, verification: Verification) -> list[tuple[str, str | Text]]:
    """What the exact check found, and what it could not check."""
    failed = [f"{check.what}: {check.detail}" for check in verification.checks if check.verdict is Verdict.FAILED]
    if failed:
        return [("verified", Text(f"FAILED - {'; '.join(failed)}", style="bold red"))]
    rows: list[tuple[str, str | Text]] = []
    if result.chosen is not None:
        what = "coverage, requirements and objective recomputed in exact arithmetic, without a solver"
        rows.append(("verified", Text("yes", style="green").append(f" - {what}", style="default")))
    elif result.status is Status.INFEASIBLE and all(c.verdict is Verdict.PASSED for c in verification.checks):
        found = verification.checks[-1].detail
        rows.append(("verified", Text("yes", style="green").append(f" - {found}", style="default")))
    unproven = [check.detail for check in verification.checks if check.verdict is Verdict.UNCHECKED]
    if unproven:
        rows.append(("on trust", "; ".join(unproven)))
    return rows


def checks(verification: Verification) -> Table:
    """Every check of a verification."""
    table = grid(("check", "left"), ("verdict", "left"), ("detail", "fill"))
    for check in verification.checks:
        table.add_row(check.what, Text(str(check.verdict), style=VERDICTS[check.verdict]), check.detail)
    return table


def diagnosed(instance: Instance, diagnosis: Diagnosis) -> Table:
    """Why there is no plan: the elements that fall short and the cliques that bind."""
    if diagnosis.unreachable:
        table = grid(("out of reach", "fill"), ("required", "right"), ("at most", "right"), ("cliques that bind", "fill"))
        for far in diagnosis.unreachable[:MOST_ROWS]:
            table.add_row(
                instance.meta.element(far.element),
                number(far.required),
                number(round(far.ceiling, 6)),
                _cliques(far.cliques),
            )
    else:
        table = grid(("left short", "fill"), ("required", "right"), ("covered", "right"), ("cliques that bind", "fill"))
        for unmet in diagnosis.unmet[:MOST_ROWS]:
            table.add_row(
                instance.meta.element(unmet.element), number(unmet.required), number(unmet.coverage), _cliques(unmet.cliques)
            )
    return cut(table, max(len(diagnosis.unreachable), len(diagnosis.unmet)))


def cut(table: Table, rows: int) -> Table:
    """The table, with a caption if it shows only the first of its rows."""
    if rows > MOST_ROWS:
        table.caption = f"and {rows - MOST_ROWS} more; --json lists all"
        table.caption_justify = "left"
    return table


def _relation(result: Result) -> Relation | None:
    """Of the result's formulation with its parameters; None if it cannot be made again from the result."""
    try:
        return registry.formulation(result.formulation, json.loads(result.options)).relation
    except PscoverError:
        return None


def _cliques(cliques: tuple[int, ...]) -> str:
    return listed([str(k) for k in cliques], 6) if cliques else NOTHING
