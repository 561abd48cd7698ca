"""The study as files: tables in Markdown and CSV, and the picture; all from the sweeps that a folder holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pscover.evidence.study.families import FAMILIES
from pscover.evidence.study.promises import Plans, joint_table, outcome_table, price_table
from pscover.evidence.study.solves import exact_formulations
from pscover.evidence.study.speed import Speed, duel_table, families, size_table, time_table, times
from pscover.evidence.tables import Table
from pscover.files import write_bytes

FIGURE = "profile.svg"
PAGE = "study.md"


@dataclass(frozen=True)
class Study:
    """All that was measured."""

    speed: Speed
    plans: Plans


def tables(study: Study) -> list[Table]:
    """In the order of reading."""
    speed, plans = study.speed, study.plans
    plain, other = exact_formulations(covers=True), exact_formulations(covers=False)
    made = [
        size_table(speed, list(dict.fromkeys(case.formulation for case in speed.models.cases))),
        time_table(speed, plain, "study-times", "The problem itself: formulations on engines"),
    ]
    made += [duel_table(speed, plain[0], name) for name in plain[1:]]
    made.append(time_table(speed, other, "study-other-times", "Other exact goals on engines"))
    made += [price_table(plans), outcome_table(plans), joint_table(plans)]
    return [table for table in made if table.rows]


def write_study(study: Study, folder: Path, made: Sequence[Table]) -> list[Path]:
    """The tables as CSV, and the page.

    Raises
    ------
    PscoverError
        If a file cannot be written.
    """
    written = []
    for table in made:
        written.append(folder / f"{table.name}.csv")
        write_bytes(written[-1], table.csv().encode())
    written.append(folder / PAGE)
    write_bytes(written[-1], page(study, made).encode())
    return written


def draw(study: Study, folder: Path) -> Path:
    """The performance profiles of the problem itself.

    Raises
    ------
    MissingDependency
        Without matplotlib.
    """
    from pscover.figures.performance import save_performance_figure

    path = folder / FIGURE
    save_performance_figure(times(study.speed, exact_formulations(covers=True)), study.speed.limit, path)
    return path


def page(study: Study, made: Sequence[Table]) -> str:
    """The tables with their notes, what they were measured on first."""
    parts = ["# Formulations compared", _instances(study), _machines(study), f"![performance profiles]({FIGURE})"]
    for table in made:
        parts += [f"## {table.title}", table.markdown(), *table.notes]
    return "\n\n".join(parts) + "\n"


def _instances(study: Study) -> str:
    cases = study.speed.models.cases
    lines = ["| family | instances | what | candidates | elements |", "|---|---:|---|---:|---:|"]
    for family in families(case.problem for case in cases):
        own = {case.problem: study.speed.models.row(case) for case in cases if case.problem.family == family}
        rows = [row for row in own.values() if row is not None]
        candidates, elements = (
            f"{min(sizes)}–{max(sizes)}" if min(sizes) < max(sizes) else str(sizes[0])
            for sizes in ([row.candidates for row in rows], [row.elements for row in rows])
        )
        lines.append(f"| {family} | {len(own)} | {FAMILIES[family].what} | {candidates} | {elements} |")
    return "\n".join(lines)


def _machines(study: Study) -> str:
    found = dict.fromkeys((*study.speed.solves.machines, *study.plans.store.machines))
    lines = []
    for machine in found:
        packages = ", ".join(f"{name} {version}" for name, version in machine.packages)
        lines.append(f"{machine.processor}, {machine.cores} cores, {machine.system}, Python {machine.python}; {packages}.")
    return "Measured on: " + "\n".join(lines)
