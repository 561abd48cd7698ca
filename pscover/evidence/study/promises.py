"""Tables of promises: what they cost in grasps, and how often they were kept."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pscover.evidence.study.averages import geometric_mean
from pscover.evidence.study.families import Problem
from pscover.evidence.study.outcomes import WORLDS, Outcome
from pscover.evidence.study.price import PROMISES, TOGETHER, PlanCase, PlanTiming
from pscover.evidence.study.solves import End, SolveRow
from pscover.evidence.study.speed import families
from pscover.evidence.study.wilson import share_interval
from pscover.evidence.sweep import Store
from pscover.evidence.tables import NOTHING, Table, interval, number
from pscover.experiment.statistics import bootstrap

FIRST = "clique"
"""The promise that others are compared with."""


@dataclass(frozen=True)
class Plans:
    """What promises brought.

    Parameters
    ----------
    store
        The sweep.
    """

    store: Store[PlanCase, SolveRow, PlanTiming]

    def timing(self, problem: Problem, promise: str) -> PlanTiming | None:
        """One plan; None if it was not looked for."""
        return self.store.timing(PlanCase(problem=problem, promise=promise))

    def problems(self, family: str | None = None) -> list[Problem]:
        """All that were looked at."""
        listed = list(dict.fromkeys(case.problem for case in self.store.cases))
        return [problem for problem in listed if family is None or problem.family == family]

    def outcomes(self, promise: str, world: str) -> dict[Problem, Outcome]:
        """What came of the plans of a promise in a world, where there is a plan."""
        timings = {problem: self.timing(problem, promise) for problem in self.problems()}
        return {
            problem: outcome
            for problem, timing in timings.items()
            if timing is not None
            for outcome in timing.outcomes
            if outcome.world == world
        }


def price_table(plans: Plans) -> Table:
    """Cost of every promise relative to the paper's, by family."""
    kinds = families(plans.problems())
    rows = []
    for promise, what in PROMISES.items():
        listed = plans.problems()
        proven, span = _ratios(plans, listed, promise), _spans(plans, listed, promise)
        ends = [timing.solve.end for problem in listed if (timing := plans.timing(problem, promise)) is not None]
        rows.append(
            (
                promise,
                what.what,
                str(ends.count(End.SOLVED)),
                str(ends.count(End.INFEASIBLE)),
                str(sum(end not in (End.SOLVED, End.INFEASIBLE) for end in ends)),
                interval(geometric_mean(proven), len(proven)) if proven else NOTHING,
                _between(span),
                *(_price(plans, plans.problems(kind), promise) for kind in kinds),
            )
        )
    return Table(
        name="study-price",
        title="What a promise costs",
        columns=("promise", "in words", "proven", "impossible", "open", "cost ratio", "open ones", *kinds),
        rows=tuple(rows),
        text_columns=frozenset({"promise", "in words"}),
        notes=(
            f"Cost of the cheapest plan / that of `{FIRST}` on the same instance: with equal costs, extra grasps. "
            "Geometric means over the instances on which both plans are proven optimal, with 95 % by the bootstrap over "
            "instances. `impossible`: proven that no plan keeps the promise; such instances are in no ratio. `open`: not "
            "proven in time; what is known of them is between the ratio of the proven bound and that of the plan found, "
            "geometric means, without an end where one has no bound or plan. By family: the ratio of the proven "
            "ones, or what is known of the open ones.",
        ),
    )


def _ratios(plans: Plans, problems: Sequence[Problem], promise: str) -> list[float]:
    """Of the instances on which both plans are proven."""
    pairs = [(plans.timing(problem, promise), plans.timing(problem, FIRST)) for problem in problems]
    return [
        mine.solve.cost / base.solve.cost
        for mine, base in pairs
        if mine is not None and base is not None
        if mine.solve.end is base.solve.end is End.SOLVED and mine.solve.cost is not None and base.solve.cost
    ]


def _spans(plans: Plans, problems: Sequence[Problem], promise: str) -> list[tuple[float, float]]:
    """Least and largest ratio that is possible, on the instances on which one of the plans is not proven."""
    spans = []
    for problem in problems:
        mine, base = plans.timing(problem, promise), plans.timing(problem, FIRST)
        if mine is None or base is None or mine.solve.end is End.INFEASIBLE or base.solve.cost is None:
            continue
        if promise == FIRST or (mine.solve.end is End.SOLVED and base.solve.end is End.SOLVED):
            continue
        least = (mine.solve.bound or 0.0) / base.solve.cost
        dearest = math.inf if mine.solve.cost is None else mine.solve.cost / (base.solve.bound or base.solve.cost)
        spans.append((least, dearest))
    return spans


def _between(spans: Sequence[tuple[float, float]]) -> str:
    """Geometric means of both ends, as far as every instance has them."""
    if not spans:
        return NOTHING
    low = geometric_mean([low for low, _ in spans]).mean if all(low > 0 for low, _ in spans) else None
    high = geometric_mean([high for _, high in spans]).mean if all(math.isfinite(high) for _, high in spans) else None
    if low is None:
        return NOTHING if high is None else f"to {high:.2f}"
    return f"from {low:.2f}" if high is None else f"{low:.2f}–{high:.2f}"


def _price(plans: Plans, problems: Sequence[Problem], promise: str) -> str:
    proven, spans = _ratios(plans, problems, promise), _spans(plans, problems, promise)
    cells = [f"{geometric_mean(proven).mean:.2f}"] if proven else []
    cells += [_between(spans)] if spans else []
    return ", ".join(cells) if cells else "impossible" if _none(plans, problems, promise) else NOTHING


def _none(plans: Plans, problems: Sequence[Problem], promise: str) -> bool:
    timings = [plans.timing(problem, promise) for problem in problems]
    return all(timing is not None and timing.solve.end is End.INFEASIBLE for timing in timings)


def outcome_table(plans: Plans) -> Table:
    """What came of the plans of every promise in every world."""
    rows = []
    for promise in PROMISES:
        for world in WORLDS:
            found = plans.outcomes(promise, world.name)
            if found:
                rows.append((promise, world.name, str(len(found)), *_outcome(plans, promise, world.name)))
    gain = f"points over {FIRST}"
    return Table(
        name="study-outcomes",
        title="Whether promises are kept",
        columns=(
            "promise",
            "world",
            "plans",
            "covered %",
            gain,
            "worst element",
            "broken %",
            "all at once %",
            "predicted %",
        ),
        rows=tuple(rows),
        text_columns=frozenset({"promise", "world"}),
        filters=("promise", "world"),
        notes=(
            "Every plan was tried many times in every world; a promise has plans on some of the instances only. "
            f"`covered`: mean share of elements covered, with 95 % by the bootstrap over instances. `{gain}`: mean "
            f"difference to the plan of `{FIRST}` on the same instances in the same world, in percentage points, with its "
            "interval. `worst element`: how much more often than required the worst element of a plan is covered, in "
            "percentage points, mean over plans; below 0 where the promise is broken. `broken`: share of elements that "
            "fall short of their requirement beyond chance (99.9 % Wilson interval). `all at once`: share of trials in "
            "which nothing was missed, pooled over plans, with its 95 % Wilson interval for these very plans; "
            "`predicted`: what the product of the coverages says, as if all successes were independent.",
        ),
    )


def _outcome(plans: Plans, promise: str, world: str) -> tuple[str, ...]:
    found, base = plans.outcomes(promise, world), plans.outcomes(FIRST, world)
    outcomes = list(found.values())
    covered = bootstrap([100 * outcome.covered for outcome in outcomes])
    gains = [100 * (outcome.covered - base[problem].covered) for problem, outcome in found.items() if problem in base]
    together = share_interval(sum(o.together for o in outcomes), sum(o.trials for o in outcomes))
    timings = [plans.timing(problem, promise) for problem in found]
    predicted = [timing.predicted for timing in timings if timing is not None and timing.predicted is not None]
    return (
        interval(covered, len(outcomes)),
        interval(bootstrap(gains), len(gains)) if gains and promise != FIRST else NOTHING,
        f"{-100 * sum(o.worst for o in outcomes) / len(outcomes):+.1f}",
        f"{100 * sum(o.broken for o in outcomes) / len(outcomes):.1f}",
        f"{100 * together.mean:.1f} ({100 * together.low:.1f}–{100 * together.high:.1f})",
        number(100 * sum(predicted) / len(predicted)),
    )


def joint_table(plans: Plans) -> Table:
    """Whether plans that promise all elements at once keep that, world by world."""
    rows = []
    for promise in ("clique", "robust", "even split", "joint", "scenario"):
        for world in WORLDS:
            found = list(plans.outcomes(promise, world.name).values())
            if not found:
                continue
            low = [share_interval(outcome.together, outcome.trials, 0.999) for outcome in found]
            kept = sum(one.high >= TOGETHER for one in low)
            rows.append((promise, world.name, f"{kept} of {len(found)}", f"{100 * min(one.mean for one in low):.1f}"))
    return Table(
        name="study-joint",
        title=f"All elements at once with {TOGETHER:g}: who keeps it",
        columns=("promise", "world", "kept", "worst plan %"),
        rows=tuple(rows),
        text_columns=frozenset({"promise", "world"}),
        notes=(
            "Kept: the upper end of the 99.9 % Wilson interval of a plan's share of trials without a miss reaches "
            f"{TOGETHER:g}. Only `joint` and `even split` promise it.",
        ),
    )
