"""One solve's search: run the engine, objective by objective, and keep the best plan by evidence and not by claim."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from pscover import isolate
from pscover.backend import Backend
from pscover.clock import Clock
from pscover.errors import Refused
from pscover.formulation import Formulation, Relation
from pscover.goal import Evidence
from pscover.instance import Instance, IntArray
from pscover.model import Model
from pscover.result import VALUE_TOLERANCE, Answer, Observer, Progress, Settings, Status, Stop

CHEAP = 2.0**-10
"""Costs that are all below this are multiplied by a power of two for the engine, whose tolerances would swallow them."""

INLINE_LIMIT = 2_000_000
"""Most entries of a model that an engine may have in the caller's process when there is a deadline."""
CUT_ROUNDS = 50
"""How often a plan that an engine's tolerances let through is cut off before its shortfall is reported instead."""


@dataclass
class Search:
    """The best plan so far over all the runs of one solve, and the trace of how it got better.

    Parameters
    ----------
    instance, formulation
        What is solved, and towards which goal.
    clock
        Started when the solve was called.
    observe
        The caller's observer.
    margin
        By how much the requirements of the models are above those of the instance.
    """

    instance: Instance
    formulation: Formulation
    clock: Clock
    observe: Observer
    margin: float = 0.0

    def __post_init__(self) -> None:
        self.plan: IntArray | None = None
        self.evidence: Evidence | None = None
        self.trace: list[Progress] = []
        self.stopped = False

    @property
    def objective(self) -> float:
        """First objective of the best feasible plan; infinite while there is none."""
        return float(self.evidence.value[0]) if self.evidence is not None and self.has_feasible_plan else math.inf

    @property
    def has_feasible_plan(self) -> bool:
        """Whether the best plan meets every requirement of the goal."""
        return self.evidence is not None and self.evidence.is_feasible

    @property
    def proves(self) -> bool:
        """Whether what is proven of the model holds for the goal: its plans are not just some of the goal's."""
        return self.formulation.relation is not Relation.RESTRICTION and self.margin == 0

    def refutes(self, bound: float) -> bool:
        """Whether the best plan is better than a claimed bound allows, by more than rounding."""
        return bound > self.objective + VALUE_TOLERANCE * max(1.0, abs(self.objective))

    def weigh(self, chosen: IntArray) -> Evidence:
        """What a plan is worth, in floating point."""
        return self.formulation.goal.evaluate(self.instance, chosen.tolist(), float)

    def offer(self, chosen: IntArray) -> bool:
        """Take the plan if it is better than the best; True if it was taken."""
        if len(self.instance.conflicts.broken_by(chosen)):
            return False
        evidence = self.weigh(chosen)
        if self.evidence is not None and not _is_better(evidence, self.evidence):
            return False
        self.plan, self.evidence = chosen, evidence
        self.plan.setflags(write=False)
        return True

    def note(self, bound: float, stage: int) -> Callable[[Progress], bool]:
        """The observer of one run: stamps, checks and passes on what the engine reports."""

        def seen(progress: Progress) -> bool:
            taken = progress.chosen is not None and self.offer(progress.chosen)
            last = self.trace[-1].bound if self.trace else -math.inf
            claimed = progress.bound if stage == 0 and not math.isnan(progress.bound) else bound
            known = max(claimed, last) if self.proves and not self.refutes(claimed) else last
            mine = Progress(
                seconds=self.clock.elapsed, objective=self.objective, bound=known, chosen=self.plan if taken else None
            )
            if taken or known > last:
                self.trace.append(mine)
                self.stopped = bool(self.observe(mine)) or self.stopped
            return self.stopped

        return seen

    def run(self, engine: Backend, model: Model, settings: Settings) -> Answer:
        """Run the objectives in order of priority; the answer's bound is that of the first."""
        first: Answer | None = None
        extra: list[tuple[csr_array, float]] = []
        for stage, objective in enumerate((model.c, *model.then)):
            staged = model if not model.then else model.with_objective(objective)
            for row, limit in extra:
                staged = staged.with_rows(row, np.array([-np.inf]), np.array([limit]))
            answer = self._exactly(engine, staged, settings, stage, -math.inf if first is None else first.bound)
            if self.plan is not None:
                settings = replace(settings, start=tuple(self.plan.tolist()))
            first = answer if first is None else first
            if answer.status is not Status.OPTIMAL or self.evidence is None:
                status = Status.FEASIBLE if stage and answer.status is Status.INFEASIBLE else answer.status
                return replace(answer, bound=first.bound, status=status)
            reached = float(self.evidence.value[stage])
            row = csr_array(objective[None, :])
            extra.append((row, reached + VALUE_TOLERANCE * max(1.0, abs(reached))))
        assert first is not None
        return replace(answer, bound=first.bound)

    def _exactly(self, engine: Backend, model: Model, settings: Settings, stage: int, bound: float) -> Answer:
        """Run one engine on one objective; cut off plans that only its tolerances let through, and run again."""
        reason = engine.refuses(model)
        if reason is not None:
            raise Refused(f"backend {engine.name!r} refuses formulation {self.formulation.name!r}: {reason}")
        problem = self.instance.with_margin(self.margin)
        for _ in range(CUT_ROUNDS):
            answer = self._engine(engine, model, replace(settings, time=max(self.clock.left, 1e-3)), stage, bound)
            if answer.chosen is None or self.formulation.relation is Relation.RESTRICTION:
                return answer
            self.offer(answer.chosen)
            if self.weigh(answer.chosen).is_feasible or answer.stop is not Stop.FINISHED or self.clock.is_over:
                return answer
            groups = self.formulation.goal.missing(problem, answer.chosen.tolist())
            if any(len(group) == 0 for group in groups):
                return Answer(status=Status.INFEASIBLE, chosen=None, bound=answer.bound, message=answer.message)
            if not groups:
                return answer
            model = _cut(model, groups)
        return answer

    def _outgrows_inline(self, engine: Backend, model: Model) -> bool:
        """Whether single steps of an engine may outlast a deadline: it looks at the clock only between them."""
        is_importable = type(engine).__module__ != "__main__"
        return is_importable and model.nonzeros > INLINE_LIMIT and math.isfinite(self.clock.seconds)

    def _engine(self, engine: Backend, model: Model, settings: Settings, stage: int, bound: float) -> Answer:
        seen = self.note(bound, stage)
        unit = _unit(model)

        def heard(progress: Progress) -> bool:
            return seen(replace(progress, bound=progress.bound / unit))

        priced = model if unit == 1 else replace(model, c=model.c * unit, offset=model.offset * unit)
        if engine.isolated or self._outgrows_inline(engine, priced):
            answer = isolate.run(engine, priced, settings, heard, self.clock)
        else:
            try:
                answer = engine.solve(priced, settings, heard)
            except KeyboardInterrupt:
                answer = Answer(status=Status.UNKNOWN, chosen=None, bound=-math.inf, stop=Stop.INTERRUPT)
        proof = None if answer.certificate is None else answer.certificate.times(unit)
        answer = replace(answer, bound=answer.bound / unit, certificate=proof)
        seen(Progress(seconds=0.0, objective=math.inf, bound=answer.bound, chosen=answer.chosen))
        return answer


def _unit(model: Model) -> float:
    """What to multiply the objective with so that its largest coefficient is near 1, if all are tiny; else 1."""
    dearest = float(np.max(np.abs(model.c), initial=0.0))
    return 2.0 ** min(1000, -math.frexp(dearest)[1]) if 0 < dearest < CHEAP else 1.0


def _cut(model: Model, groups: list[Any]) -> Model:
    starts = np.cumsum([0, *(len(group) for group in groups)])
    members = np.concatenate([np.asarray(group, dtype=np.int32) for group in groups])
    rows = csr_array((np.ones(len(members)), members, starts), shape=(len(groups), model.variables))
    return model.with_rows(rows, np.ones(len(groups)), np.full(len(groups), np.inf))


def _is_better(new: Evidence, old: Evidence) -> bool:
    if new.is_feasible != old.is_feasible:
        return new.is_feasible
    if not new.is_feasible:
        return sum(new.shortfall) < sum(old.shortfall)
    *prior, (last, best) = zip(new.value, old.value, strict=True)
    for a, b in prior:
        slack = VALUE_TOLERANCE * max(1.0, abs(float(a)), abs(float(b)))
        if abs(float(a) - float(b)) > slack:
            return a < b
    return last < best
