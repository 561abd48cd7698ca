"""Tables of what formulations are to engines: size, relaxation, time, nodes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from pscover import registry
from pscover.evidence.study.averages import PENALTY, SHIFT, geometric_mean, penalised, shifted_mean
from pscover.evidence.study.families import FAMILIES, Problem
from pscover.evidence.study.models import ModelCase, ModelRow, ModelTiming
from pscover.evidence.study.solves import FINAL, End, SolveCase, SolveRow, SolveTiming
from pscover.evidence.sweep import Store
from pscover.evidence.tables import NOTHING, Table, interval, number
from pscover.formulation import Relation
from pscover.goal import Cover

Pair = tuple[str, str]
"""A formulation and an engine."""


@dataclass(frozen=True)
class Speed:
    """What was measured of models and of engines.

    Parameters
    ----------
    models, solves
        The sweeps.
    limit
        CPU seconds of each solve.
    """

    models: Store[ModelCase, ModelRow, ModelTiming]
    solves: Store[SolveCase, SolveRow, SolveTiming]
    limit: float

    @cached_property
    def runs(self) -> dict[SolveCase, SolveTiming]:
        """All solves."""
        timings = {case: self.solves.timing(case) for case in self.solves.cases}
        return {case: timing for case, timing in timings.items() if timing is not None}

    def problems(self, formulations: Iterable[str]) -> list[Problem]:
        """Those on which all of the formulations were given to all engines."""
        own = {case for case in self.runs if case.formulation in set(formulations)}
        wanted = {(case.formulation, case.backend) for case in own}
        done: dict[Problem, set[Pair]] = {}
        for case in self.runs:
            if case in own:
                done.setdefault(case.problem, set()).add((case.formulation, case.backend))
        return [problem for problem, pairs in done.items() if pairs == wanted]

    def pairs(self, formulations: Iterable[str]) -> list[Pair]:
        """Formulations with the engines that are there and take them on every instance, in that order."""
        listed = list(formulations)
        problems = set(self.problems(listed))
        engines = dict.fromkeys(case.backend for case in self.runs)
        idle = {
            (case.formulation, case.backend)
            for case, run in self.runs.items()
            if case.problem in problems and run.end in (End.REFUSED, End.MISSING)
        }
        return [(form, engine) for form in listed for engine in engines if problems and (form, engine) not in idle]

    def run(self, problem: Problem, pair: Pair) -> SolveTiming:
        """One of them."""
        return self.runs[SolveCase(problem=problem, formulation=pair[0], backend=pair[1])]

    def seconds(self, problem: Problem, pair: Pair) -> float:
        """CPU seconds to a proof; infinite without one."""
        run = self.run(problem, pair)
        return run.seconds if run.end in FINAL and run.seconds is not None else math.inf

    def penalised(self, problem: Problem, pair: Pair) -> float:
        """CPU seconds, those without a proof counted as `PENALTY` limits."""
        run = self.run(problem, pair)
        return penalised(run.seconds, solved=run.end in FINAL, limit=self.limit)

    def best(self, problem: Problem, formulation: str) -> tuple[float, bool]:
        """The least cost that anybody found towards the formulation's goal, and whether it is proven; infinite for none."""
        same = goal_mates(formulation)
        runs = [run for case, run in self.runs.items() if case.problem == problem and case.formulation in same]
        cost = min((run.cost for run in runs if run.cost is not None), default=math.inf)
        return cost, any(run.end is End.SOLVED and run.cost is not None and run.cost <= cost + 1e-6 for run in runs)


def goal_mates(formulation: str) -> set[str]:
    """Exact formulations whose best plans cost the same.

    Examples
    --------
    >>> sorted(goal_mates("pairwise")), goal_mates("robust")
    (['clique', 'pairwise'], {'robust'})
    """
    names = registry.names("formulation")
    goals = {name: registry.formulation(name) for name in names}
    plain = {name for name, form in goals.items() if isinstance(form.goal, Cover) and form.relation is Relation.EXACT}
    return plain if formulation in plain else {formulation}


def families(problems: Iterable[Problem]) -> list[str]:
    """Those of some problems, in their usual order."""
    there = {problem.family for problem in problems}
    return [name for name in FAMILIES if name in there]


def size_table(speed: Speed, formulations: Sequence[str]) -> Table:
    """Size, linear relaxation and its gap, by family and formulation."""
    rows = []
    for family in families(case.problem for case in speed.models.cases):
        for formulation in formulations:
            cases = [c for c in speed.models.cases if c.problem.family == family and c.formulation == formulation]
            if cases:
                rows.append((family, formulation, *_sizes(speed, cases)))
    return Table(
        name="study-sizes",
        title="Size of the models and strength of their linear relaxations",
        columns=("family", "formulation", "rows", "columns", "nonzeros", "root gap %", "proven", "LP s"),
        rows=tuple(rows),
        text_columns=frozenset({"family", "formulation", "proven"}),
        filters=("family", "formulation"),
        notes=(
            "Means over the seeds of a family (geometric for sizes). Root gap: (best plan known - optimum of the linear "
            "relaxation) / best plan known, the plan of the same goal by any engine; `proven` counts the instances on "
            "which that plan is proven optimal, on the others the true gap is at most the one shown. One engine, HiGHS, "
            "solved all relaxations, on the models as they are built: what presolve and cuts add is in the times. elastic "
            "has several objectives, of which the first is no cost: no root gap. `no plan`: the relaxation alone shows "
            "that there is none.",
        ),
    )


def _sizes(speed: Speed, cases: Sequence[ModelCase]) -> tuple[str, ...]:
    rows = [row for case in cases if (row := speed.models.row(case)) is not None]

    def mean(pick: Callable[[ModelRow], int | None]) -> str:
        known = [float(size) for row in rows if (size := pick(row)) is not None]
        return f"{geometric_mean([max(1.0, k) for k in known]).mean:,.0f}".replace(",", " ") if known else NOTHING

    gaps, proofs = [], 0
    for case in cases:
        row = speed.models.row(case)
        cost, proven = speed.best(case.problem, case.formulation)
        if row is None or row.relaxation is None or not math.isfinite(cost):
            continue
        gaps.append(100 * (cost - row.relaxation) / cost)
        proofs += proven
    times = [timing.relaxation for case in cases if (timing := speed.models.timing(case)) and timing.relaxation is not None]
    empty = sum(row.empty for row in rows)
    gap = f"{sum(gaps) / len(gaps):.1f}" if gaps else f"no plan ({empty} of {len(rows)})" if empty else NOTHING
    seconds = number(shifted_mean(times).mean) if times else NOTHING
    sizes = (mean(lambda row: row.rows), mean(lambda row: row.variables), mean(lambda row: row.nonzeros))
    return (*sizes, gap, f"{proofs} of {len(gaps)}" if gaps else NOTHING, seconds)


def time_table(speed: Speed, formulations: Sequence[str], name: str, title: str) -> Table:
    """Solved instances, time and nodes of every formulation on every engine, and times by family."""
    problems = speed.problems(formulations)
    kinds = families(problems)
    rows = []
    for pair in speed.pairs(formulations):
        times = [speed.penalised(problem, pair) for problem in problems]
        solved = sum(speed.seconds(problem, pair) < math.inf for problem in problems)
        by_family = (_family_cell(speed, [p for p in problems if p.family == kind], pair) for kind in kinds)
        overall = interval(shifted_mean(times), len(times)) if times else NOTHING
        rows.append((*pair, f"{solved} of {len(problems)}", overall, _nodes(speed, problems, pair), *by_family))
    limit = f"{speed.limit:g}"
    return Table(
        name=name,
        title=title,
        columns=("formulation", "engine", "solved", "CPU s", "nodes", *kinds),
        rows=tuple(rows),
        text_columns=frozenset({"formulation", "engine"}),
        filters=("formulation", "engine"),
        notes=(
            f"CPU seconds of the engine's processes and of building the model, one thread, {limit} s at most. Shifted "
            f"geometric means (shift {SHIFT:g} s) over instances; one that is not proven in time counts as {PENALTY:g} "
            f"limits, {PENALTY * speed.limit:g} s. In brackets 95 % by the bootstrap over instances. By family: the mean, "
            "and in brackets how many instances are not proven, if any. Solved: a plan proven optimal, or proven that "
            "there is none. `nodes`: of branch and bound as the engine counts them, over the instances that it solved. "
            "Not in the table: engines that refuse a formulation on some instance, or are not installed.",
        ),
    )


def _nodes(speed: Speed, problems: Sequence[Problem], pair: Pair) -> str:
    runs = [speed.run(problem, pair) for problem in problems]
    nodes = [float(run.nodes) for run in runs if run.end in FINAL and run.nodes is not None]
    return number(shifted_mean(nodes, 1.0).mean) if nodes else NOTHING


def _family_cell(speed: Speed, problems: Sequence[Problem], pair: Pair) -> str:
    if not problems:
        return NOTHING
    mean = shifted_mean([speed.penalised(problem, pair) for problem in problems]).mean
    unsolved = sum(speed.seconds(problem, pair) == math.inf for problem in problems)
    return number(mean) + (f" ({unsolved} open)" if unsolved else "")


def duel_table(speed: Speed, one: str, other: str) -> Table:
    """Two formulations against each other, engine by engine, on the same instances."""
    problems = speed.problems((one, other))
    rows = []
    engines = [engine for form, engine in speed.pairs((one, other)) if form == one]
    for engine in engines:
        mine, its = (one, engine), (other, engine)
        ratios = [speed.penalised(p, its) / speed.penalised(p, mine) for p in problems]
        both = [p for p in problems if max(speed.seconds(p, mine), speed.seconds(p, its)) < math.inf]
        counted = [(speed.run(p, mine).nodes, speed.run(p, its).nodes) for p in both]
        nodes = [(a, b) for a, b in counted if a is not None and b is not None]
        rows.append(
            (
                engine,
                str(sum(speed.seconds(p, mine) < math.inf for p in problems)),
                str(sum(speed.seconds(p, its) < math.inf for p in problems)),
                interval(geometric_mean(ratios), len(ratios)) if ratios else NOTHING,
                number(geometric_mean([max(1, b) / max(1, a) for a, b in nodes]).mean) if nodes else NOTHING,
                str(len(nodes)) if nodes else NOTHING,
            )
        )
    return Table(
        name=f"study-{one}-{other}",
        title=f"`{other}` against `{one}`",
        columns=("engine", f"{one} solved", f"{other} solved", "time ratio", "node ratio", "of"),
        rows=tuple(rows),
        text_columns=frozenset({"engine"}),
        notes=(
            f"Of {len(problems)} instances. Ratios {other} / {one}, above 1 where {one} is better: geometric means, of "
            f"times over all instances (unproven ones as {PENALTY:g} limits, which hides differences where both are open) "
            "with 95 % by the bootstrap over instances; of nodes over the instances that both proved, as the engine "
            "counts them. `auto` and CP-SAT keep no count of nodes.",
        ),
    )


def times(speed: Speed, formulations: Sequence[str]) -> Mapping[Pair, list[float]]:
    """CPU seconds to the proof of every formulation on every engine, infinite without one: for the profiles."""
    problems = speed.problems(formulations)
    return {pair: [speed.seconds(problem, pair) for problem in problems] for pair in speed.pairs(formulations)}
