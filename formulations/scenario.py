r"""Correlated outcomes as sampled scenarios: each element must be covered in enough of them.

**Data.** Scenarios $s = 1, \dots, S$; $N_{js}$ the candidates that cover element $j$ in scenario $s$ (one draw, or one
recorded trial, of success for every stored $p_{ij}$); $k_j = \lceil q_j S \rceil$; cliques $Q$ of candidates that
exclude each other.

**Variables.** $x_i \in \lbrace 0, 1 \rbrace$: candidate $i$ is in the plan; $z_{js} \in \lbrace 0, 1 \rbrace$: element
$j$ counts as covered in scenario $s$.

$$\min \sum_i c_i x_i \quad \text{s.t.} \quad z_{js} \le \sum_{i \in N_{js}} x_i \quad \forall j, s,
\qquad \sum_s z_{js} \ge k_j \quad \forall j: q_j > 0, \qquad \sum_{i \in Q} x_i \le 1 \quad \forall Q$$

Scenarios with the same set $N_{js}$ are one variable with their number as its coefficient; those with an empty set are
left out. Demands are rounded up after subtracting $10^{-9} S$, so that $q_j = 0.7$ asks for 70 of 100 scenarios.

**Draws.** Unless `outcomes` gives them, scenarios come from a Gaussian copula with one factor: in scenario $s$ the pair
$(i, j)$ succeeds when $\sqrt{\rho} F_s + \sqrt{1 - \rho} E_{ijs} \le \Phi^{-1}(p_{ij})$ with $F_s$ and $E_{ijs}$
independent standard normal numbers. Each success has probability $p_{ij}$ exactly; $\rho$ = `correlation` is 0 for
independence and 1 when one common cause decides everything, such as a miscalibrated camera.

- **Relation:** exact for the scenarios. For the distribution they were drawn from it is a sample average approximation,
  too optimistic on average: check the plan on scenarios of another `seed`.
- **Size:** at most $n + m_+ S$ variables, $m_+ (S + 1) + |Q|$ rows, $m_+$ the elements with $q_j > 0$, and $2 m_+ S$
  non-zeros plus one for each success in those rows and each clique member; fewer as scenarios coincide. Refused when
  $S$ times the number of stored $p_{ij}$ exceeds 20 million.
- **Use it** when grasps fail together, which the product of misses ignores, or with recorded trials in the place of a
  predictor.
- **Source:** correlated probabilistic set covering: Ahmed and Papageorgiou 2013; sample average approximation of chance
  constraints: Luedtke and Ahmed 2008; the copula: Li 2000.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from math import ceil
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_array, csr_array
from scipy.special import ndtri

from pscover.errors import InvalidSettings, Refused
from pscover.formulation import Relation
from pscover.goal import Evidence, Goal, Number, total_cost
from pscover.instance import TOLERANCE, Instance
from pscover.model import Model

from ._shared import binaries, bounds, conflict_rows, expect, required_elements

OUTCOME_LIMIT = 20_000_000


@dataclass(frozen=True, slots=True, eq=False)
class ScenarioCover:
    """The cheapest plan that covers every element j in at least a share q_j of the scenarios.

    Parameters
    ----------
    outcomes
        Gives the successes for an instance, shape (scenarios, stored probabilities).
    """

    outcomes: Callable[[Instance], NDArray[np.bool_]]

    def evaluate(self, instance: Instance, chosen: Sequence[int], number: Callable[[float], Number]) -> Evidence:
        """Cost; q_j minus the share of scenarios in which element j is covered, where positive, for each element."""
        covered = self._covered(instance, chosen)
        zero, scenarios = number(0.0), number(float(len(covered)))
        shares = [number(float(count)) / scenarios for count in covered.sum(axis=0)]
        short = tuple(max(zero, number(float(q)) - share) for q, share in zip(instance.required, shares, strict=True))
        return Evidence(value=(total_cost(instance, chosen, number),), shortfall=short)

    def missing(self, instance: Instance, chosen: Sequence[int]) -> list[Sequence[int]]:
        """For each element that falls short, the candidates that cover it in a scenario in which the plan does not."""
        outcomes, covered, p = self.outcomes(instance), self._covered(instance, chosen), instance.probability
        owner = np.repeat(np.arange(instance.candidates), np.diff(p.indptr))
        short = instance.required - covered.mean(axis=0) > TOLERANCE
        groups: list[Sequence[int]] = []
        for j in np.flatnonzero(short):
            entries = np.flatnonzero(p.indices == j)
            helps = outcomes[np.ix_(~covered[:, j], entries)].any(axis=0)
            groups.append([int(i) for i in owner[entries[helps]]])
        return groups

    def _covered(self, instance: Instance, chosen: Sequence[int]) -> NDArray[np.bool_]:
        """Which element is covered in which scenario, shape (scenarios, elements)."""
        outcomes, p = self.outcomes(instance), instance.probability
        covered = np.zeros((len(outcomes), instance.elements), dtype=np.bool_)
        for i in chosen:
            span = slice(int(p.indptr[i]), int(p.indptr[i + 1]))
            covered[:, p.indices[span]] |= outcomes[:, span]
        return covered


@dataclass(frozen=True, slots=True, eq=False)
class Scenario:
    """Cheapest plan that covers each element in enough sampled or recorded scenarios.

    Parameters
    ----------
    count
        How many scenarios to draw, at least 1.
    correlation
        Correlation of the common factor in [0, 1]; 0 for independent outcomes.
    seed
        Of the draws.
    outcomes
        Your own scenarios in the place of draws: booleans of shape (scenarios, stored probabilities), the latter in the
        order of `instance.probability.data`, candidate by candidate. `count`, `correlation` and `seed` then play no part.

    Examples
    --------
    >>> instance = Instance.of([[0.5, 0.5]], required=0.75)
    >>> trials = np.array([[True, False], [True, False], [False, True], [False, False]])
    >>> goal = Scenario(outcomes=trials).goal
    >>> goal.evaluate(instance, [0, 1], float).is_feasible, goal.evaluate(instance, [0], float).shortfall
    (True, (0.25,))
    """

    count: int = 100
    correlation: float = 0.0
    seed: int = 0
    outcomes: NDArray[np.bool_] | None = field(default=None)

    name: ClassVar[str] = "scenario"
    relation: ClassVar[Relation] = Relation.EXACT
    tolerance: ClassVar[float] = 0.0

    def __post_init__(self) -> None:
        expect("count", self.count >= 1, "a whole number of at least 1", self.count)
        expect("correlation", 0 <= self.correlation <= 1, "a number in [0, 1]", self.correlation)
        expect("seed", self.seed >= 0, "a whole number of at least 0", self.seed)
        if self.outcomes is not None:
            own = np.array(self.outcomes)
            if own.ndim != 2 or own.dtype != np.bool_ or len(own) == 0:
                expected = "booleans of shape (scenarios, stored probabilities)"
                raise InvalidSettings(f"outcomes: expected {expected}, got {own.dtype} of shape {own.shape}")
            own.setflags(write=False)
            object.__setattr__(self, "outcomes", own)

    @property
    def goal(self) -> Goal:
        """The cheapest plan that covers every element in enough of the scenarios."""
        return ScenarioCover(self.draw)

    def draw(self, instance: Instance) -> NDArray[np.bool_]:
        """Success of every stored probability in every scenario, shape (scenarios, stored probabilities), read-only.

        Raises
        ------
        InvalidSettings
            If the given outcomes do not have one column for each stored probability.
        Refused
            If there would be more than `OUTCOME_LIMIT`.
        """
        stored = int(instance.probability.nnz)
        count = self.count if self.outcomes is None else len(self.outcomes)
        if count * stored > OUTCOME_LIMIT:
            raise Refused(f"{count} scenarios of {stored} probabilities exceed the limit of {OUTCOME_LIMIT} outcomes")
        if self.outcomes is not None:
            if self.outcomes.shape[1] != stored:
                expected = f"{stored} columns, one for each stored probability of the instance"
                raise InvalidSettings(f"outcomes: expected {expected}, got {self.outcomes.shape[1]}")
            return self.outcomes
        return _copula(instance, self.count, self.correlation, self.seed)

    def build(self, instance: Instance) -> Model:
        """Minimise cost over scenario rows, one counting row an element, and clique rows.

        Raises
        ------
        InvalidSettings, Refused
            As `draw`.
        """
        outcomes = self.draw(instance)
        rows = _Rows.of(instance, outcomes)
        n, scenarios, cliques = instance.candidates, rows.reached.shape[0], len(instance.conflicts)
        identity = csr_array((np.ones(scenarios), np.arange(scenarios), np.arange(scenarios + 1)), shape=(scenarios,) * 2)
        blocks = [[rows.reached, -identity], [None, rows.counted], [conflict_rows(instance), None]]
        return Model(
            c=np.concatenate([instance.cost, np.zeros(scenarios)]),
            A=csr_array(block_array(blocks, format="csr")),
            lo=np.concatenate([np.zeros(scenarios), rows.demand, bounds((cliques, -np.inf))]),
            hi=bounds((scenarios + len(rows.demand), np.inf), (cliques, 1.0)),
            ub=np.ones(n + scenarios),
            integer=binaries(n + scenarios),
            candidates=n,
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """Scenarios merged by their set of successes: who covers each, how many count for each element, how many must."""

    reached: csr_array
    counted: csr_array
    demand: NDArray[np.float64]

    @classmethod
    def of(cls, instance: Instance, outcomes: NDArray[np.bool_]) -> _Rows:
        p = instance.probability
        column = np.repeat(np.arange(instance.candidates), np.diff(p.indptr))
        order = np.argsort(p.indices, kind="stable")
        starts = np.searchsorted(p.indices[order], np.arange(instance.elements + 1))
        members: list[NDArray[Any]] = []
        sizes: list[NDArray[Any]] = []
        times: list[NDArray[Any]] = []
        elements, demand = required_elements(instance), []
        for j in elements:
            entries = order[starts[j] : starts[j + 1]]
            sets, multiplicity = _distinct(outcomes[:, entries])
            needed = _needed(float(instance.required[j]), len(outcomes))
            members.append(column[entries[np.nonzero(sets)[1]]])
            sizes.append(sets.sum(axis=1))
            times.append(np.minimum(multiplicity, needed))
            demand.append(float(needed))
        length = np.concatenate([*sizes, np.zeros(0, dtype=np.int64)])
        index = np.concatenate([*members, np.zeros(0, dtype=np.int64)])
        weight = np.concatenate([*times, np.zeros(0)]).astype(np.float64)
        begin = np.concatenate([[0], np.cumsum(length)])
        reached = csr_array((np.ones(len(index)), index, begin), shape=(len(length), instance.candidates))
        ends = np.concatenate([[0], np.cumsum([len(t) for t in times])]).astype(np.int64)
        counted = csr_array((weight, np.arange(len(weight)), ends), shape=(len(elements), len(weight)))
        return cls(reached=reached, counted=counted, demand=np.array(demand))


def _distinct(outcomes: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
    """The distinct non-empty rows, and how often each occurs."""
    full = outcomes[outcomes.any(axis=1)]
    if len(full) == 0:
        return full, np.zeros(0, dtype=np.intp)
    sets, times = np.unique(full, axis=0, return_counts=True)
    return sets, times


def _needed(required: float, scenarios: int) -> int:
    """In how many scenarios an element must be covered: the fewest whose share the goal accepts."""
    return max(0, ceil((Fraction(required) - Fraction(TOLERANCE)) * scenarios))


# The goal asks for the same draws at every evaluation; an instance is frozen and compares by identity.
@lru_cache(maxsize=4)
def _copula(instance: Instance, count: int, correlation: float, seed: int) -> NDArray[np.bool_]:
    """Outcomes of a one-factor Gaussian copula, shape (count, stored probabilities)."""
    random = np.random.default_rng(seed)
    threshold = ndtri(instance.probability.data)
    outcomes = np.empty((count, len(threshold)), dtype=np.bool_)
    # One scenario at a time: the numbers drawn take eight times the memory of the outcomes.
    for success in outcomes:
        common, own = random.standard_normal(), random.standard_normal(len(threshold))
        success[:] = np.sqrt(correlation) * common + np.sqrt(1.0 - correlation) * own <= threshold
    outcomes.setflags(write=False)
    return outcomes


formulation = Scenario
