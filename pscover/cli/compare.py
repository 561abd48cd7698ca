"""`pscover compare`: backends times formulations on some instances."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pscover.cli.fail import Exit
from pscover.cli.options import FILE, json_option, names, quiet_option, settings_options
from pscover.errors import EngineFailed, MissingDependency, Refused

if TYPE_CHECKING:
    from pscover.cli.live import Line
    from pscover.instance import Instance
    from pscover.result import Result, Settings


START_SECONDS = 30.0
"""For an engine to be imported and to solve a problem of one candidate."""


class Empty(StrEnum):
    """Why a cell holds no result."""

    REFUSED = "refused"
    MISSING = "missing"
    FAILED = "failed"
    INTERRUPTED = "interrupted"
    SKIPPED = "not run"


REASONS = {Refused: Empty.REFUSED, MissingDependency: Empty.MISSING, EngineFailed: Empty.FAILED}


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One backend on one formulation of one instance.

    Parameters
    ----------
    backend, formulation
        Their names.
    result
        What was found, or None.
    wrong
        What the exact check says against the result, or "".
    empty
        Why there is no result, or None.
    reason
        The same in a sentence, or "".
    """

    backend: str
    formulation: str
    result: Result | None = None
    wrong: str = ""
    empty: Empty | None = None
    reason: str = ""

    @property
    def has_verified_plan(self) -> bool:
        """Whether there is a plan that passed the exact check."""
        return self.result is not None and self.result.has_plan and not self.wrong


@click.command("compare", short_help="Compare backends and formulations on instances.")
@click.argument("instances", metavar="INSTANCE...", type=FILE, nargs=-1, required=True)
@click.option("--backends", "-b", type=names, metavar="A,B,...", help="With commas between them; all by default.")
@click.option(
    "--formulations",
    "-f",
    type=names,
    metavar="A,B,...",
    default=("clique",),
    help="With commas between them; clique by default.",
)
@settings_options(seconds=10.0)
@json_option
@quiet_option
def command(
    instances: tuple[Path, ...],
    backends: tuple[str, ...] | None,
    formulations: tuple[str, ...],
    as_json: bool,
    quiet: bool,
    **numbers: Any,
) -> Exit:
    """Solve each INSTANCE with every backend and formulation, and show what each found, how good and how fast.

    Every plan is checked in exact arithmetic. Engines are started before the clock runs. A cell without a
    result says why below the table. Ctrl-C shows what is known so far. Exit code 0 if every instance has a verified plan.

    \b
    Examples:
      pscover compare table.json --time 5
      pscover compare *.json -b highs,greedy -f clique,pairwise
    """
    from pscover import registry
    from pscover.cli.live import watching
    from pscover.io import load_instance
    from pscover.result import Settings

    settings = Settings(**numbers)
    engines = _distinct("backend", backends or registry.names("backend"))
    forms = _distinct("formulation", formulations)
    problems = [load_instance(path) for path in instances]
    with watching("", quiet=quiet) as line:
        found = dict(_cells(problems, engines, forms, settings, line))
    interrupted = any(_was_interrupted(cell) for cell in found.values())
    cells = [[found[k, form, engine] for form in forms for engine in engines] for k in range(len(problems))]
    if as_json:
        _print_document(problems, cells, interrupted=interrupted)
    else:
        _print_tables(problems, cells, interrupted=interrupted)
    if all(any(cell.has_verified_plan for cell in row) for row in cells) and not any(c.wrong for row in cells for c in row):
        return Exit.VERIFIED
    return Exit.INTERRUPTED if interrupted else Exit.NO_PLAN


def _distinct(kind: str, given: tuple[str, ...]) -> list[str]:
    from pscover import registry

    return list(dict.fromkeys(registry.lookup(kind, name).name for name in given))


def _was_interrupted(cell: Cell) -> bool:
    from pscover.result import Stop

    stopped = cell.result is not None and cell.result.stop is Stop.INTERRUPT
    return stopped or cell.empty in (Empty.INTERRUPTED, Empty.SKIPPED)


def _cells(
    problems: list[Instance], engines: list[str], forms: list[str], settings: Settings, line: Line
) -> Iterator[tuple[tuple[int, str, str], Cell]]:
    """Every cell with its place (instance, formulation, engine), engine by engine; after Ctrl-C the rest is not run."""
    interrupted = False
    for engine in engines:
        for k, problem in enumerate(problems):
            for form in forms:
                interrupted = interrupted or not _is_started(engine, line)
                if interrupted:
                    yield (k, form, engine), Cell(backend=engine, formulation=form, empty=Empty.SKIPPED)
                    continue
                line.restart(f"{problem.meta.name or 'instance'}: {engine} x {form}")
                cell = _cell(problem, engine, form, settings, line)
                interrupted = _was_interrupted(cell)
                yield (k, form, engine), cell


def _is_started(engine: str, line: Line) -> bool:
    """Let an engine import what it needs, so that no cell pays for that; False after Ctrl-C."""
    from pscover.instance import Instance
    from pscover.solve import solve

    line.restart(f"starting {engine}")
    try:
        with suppress(Refused, MissingDependency, EngineFailed):
            solve(Instance.of([[1.0]]), backend=engine, time=START_SECONDS)
    except KeyboardInterrupt:
        return False
    return True


def _cell(problem: Instance, engine: str, form: str, settings: Settings, line: Line) -> Cell:
    from pscover.solve import solve
    from pscover.verify import Verdict, verify

    try:
        result = solve(problem, backend=engine, formulation=form, settings=settings, observe=line)
        failed = [f"{c.what}: {c.detail}" for c in verify(problem, result).checks if c.verdict is Verdict.FAILED]
    except (Refused, MissingDependency, EngineFailed) as error:
        return Cell(backend=engine, formulation=form, empty=REASONS[type(error)], reason=str(error))
    except KeyboardInterrupt:
        return Cell(backend=engine, formulation=form, empty=Empty.INTERRUPTED)
    return Cell(backend=engine, formulation=form, result=result, wrong="; ".join(failed))


def contradiction(cells: list[Cell]) -> str:
    """A sentence if one cell's bound rules out another's plan, which cannot be if both are right; else ""."""
    from pscover import registry
    from pscover.goal import Cover
    from pscover.result import VALUE_TOLERANCE

    known = [
        (cell, cell.result)
        for cell in cells
        if cell.result is not None and isinstance(registry.formulation(cell.formulation).goal, Cover)
    ]
    plans = [(result.objective, cell) for cell, result in known if result.has_plan]
    bounds = [(result.bound, cell) for cell, result in known if math.isfinite(result.bound)]
    if not plans or not bounds:
        return ""
    (best, holder), (bound, claimant) = min(plans, key=lambda p: p[0]), max(bounds, key=lambda p: p[0])
    if bound <= best + VALUE_TOLERANCE * max(1.0, abs(best)):
        return ""
    return (
        f"contradiction: {claimant.backend} on {claimant.formulation} claims that no plan is better than {bound:.10g}, "
        f"but {holder.backend} on {holder.formulation} has a plan of {best:.10g}"
    )


def _print_document(problems: list[Instance], cells: list[list[Cell]], *, interrupted: bool) -> None:
    from pscover.cli.documents import instance_document
    from pscover.cli.output import show_document

    show_document(
        {
            "instances": [
                {
                    "instance": instance_document(problem),
                    "cells": [_cell_document(cell) for cell in row],
                    "contradiction": contradiction(row) or None,
                }
                for problem, row in zip(problems, cells, strict=True)
            ],
            "interrupted": interrupted,
        }
    )


def _cell_document(cell: Cell) -> dict[str, Any]:
    head = {"backend": cell.backend, "formulation": cell.formulation}
    if cell.result is None:
        return {**head, "status": cell.empty, "reason": cell.reason or None}
    result = cell.result
    return {
        **head,
        "status": result.status,
        "stop": result.stop,
        "objective": result.objective,
        "bound": result.bound,
        "gap": result.gap,
        "seconds": result.timing.total,
        "shortfall": _worst(result),
        "verified": not cell.wrong,
        "reason": cell.wrong or None,
    }


def _worst(result: Result) -> float:
    """The largest shortfall; infinite without a plan."""
    return math.inf if result.shortfall is None else float(max(result.shortfall, default=0.0))


def _print_tables(problems: list[Instance], cells: list[list[Cell]], *, interrupted: bool) -> None:
    from rich.text import Text

    from pscover.cli.output import show
    from pscover.cli.tables import STYLES, grid, headline
    from pscover.cli.words import number, percent

    for k, (problem, row) in enumerate(zip(problems, cells, strict=True)):
        names = (("backend", "left"), ("formulation", "left"), ("status", "left"))
        sizes = (("objective", "right"), ("bound", "right"), ("gap %", "right"), ("time s", "right"), ("short", "right"))
        table = grid(*names, *sizes)
        notes: list[str] = []
        for cell in row:
            if cell.reason or cell.wrong:
                notes.append(f"[{len(notes) + 1}] {cell.reason or f'{cell.backend} on {cell.formulation}: {cell.wrong}'}")
            mark = f" [{len(notes)}]" if cell.reason or cell.wrong else ""
            if cell.result is None:
                table.add_row(cell.backend, cell.formulation, Text(f"{cell.empty}{mark}", style="dim"))
                continue
            result = cell.result
            status = (
                Text(f"WRONG{mark}", style="bold red") if cell.wrong else Text(result.status, style=STYLES[result.status])
            )
            table.add_row(
                *(cell.backend, cell.formulation, status, number(result.objective), number(result.bound)),
                *(percent(result.gap).removesuffix(" %"), f"{result.timing.total:.2f}", number(_worst(result))),
            )
        show(*([""] if k else []), headline(problem), table, *notes)
        if found := contradiction(row):
            show(Text(found, style="bold red"))
    if interrupted:
        show("interrupted: this is what was known by then")
