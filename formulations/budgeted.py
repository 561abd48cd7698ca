r"""The most expected coverage that a budget buys.

**Data.** $a_{ij} = -\log(1 - p_{ij})$, $v_j \ge 0$ what element $j$ is worth (1 each unless `weights` says otherwise),
$B$ the budget, cliques $Q$ of candidates that exclude each other. The requirements $q_j$ play no part.

**Variables.** $x_i \in \lbrace 0, 1 \rbrace$: candidate $i$ is in the plan; $s_j \in [0, L]$: log weight on element
$j$; $y_j \in [0, 1]$: the probability that $j$ is missed, from below.

Element $j$ is missed with probability $\prod_i (1 - p_{ij})^{x_i} = e^{-s_j}$, convex in $s_j = \sum_i a_{ij} x_i$. Its
tangents at $K$ points $\tau_k$ give

$$\min \sum_j v_j y_j \quad \text{s.t.} \quad y_j \ge e^{-\tau_k} (1 + \tau_k - s_j) \quad \forall j, k,
\qquad s_j \le \sum_i \min(a_{ij}, L) x_i \quad \forall j,
\qquad \sum_i c_i x_i \le B, \qquad \sum_{i \in Q} x_i \le 1 \quad \forall Q$$

**Error.** With $\varepsilon = \text{tolerance} / \sum_j v_j$ the points are placed so that the largest tangent is
within $\varepsilon$ of $e^{-s}$ on $[0, -\log \varepsilon]$: between neighbouring breakpoints the chord is at most
$\varepsilon$ above $e^{-s}$, and the tangent parallel to the chord is below $e^{-s}$, hence $e^{-s}$ minus tangent is
at most chord minus tangent, which is the chord's own largest gap. From $-\log \varepsilon$ on $e^{-s} \le \varepsilon$
while $y_j \ge 0$. So for every plan
$0 \le \sum_j v_j e^{-s_j} - \sum_j v_j y_j \le \varepsilon \sum_j v_j = \text{tolerance}$. All tangents are 0 at
$L = \tau_K + 1$ at the latest, so that capping at $L$ keeps the model below the truth, and $p_{ij} = 1$ is exact:
$y_j = 0$.

- **Relation:** relaxation; every plan of the model is feasible, its objective too low by at most `tolerance`.
- **Size:** $n + 2m$ variables, $m$ the elements; $(K + 1) m + 1 + |Q|$ rows; $2 K m + m + n$ non-zeros and one for each
  stored $p_{ij}$ and each clique member; $K \le 2 + 0.72 / \sqrt{\varepsilon}$. Refused when $K m$ exceeds a million.
- **Use it** when time or trips are limited rather than success: the best plan of at most $B$ grasps.
- **Source:** expected coverage: Daskin 1983 (maximum expected covering); the log transformation of it: Haight, ReVelle,
  Snyder 2000; outer approximation: Duran and Grossmann 1986.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_array, csr_array, eye_array

from pscover.errors import InvalidSettings, Refused
from pscover.formulation import Relation
from pscover.goal import Evidence, Goal, Number, failures, total_cost
from pscover.instance import Instance
from pscover.model import Model

from ._convex import EXPONENTIAL, Lines, tangents
from ._shared import bounds, capped_rows, conflict_rows, expect, leading

LINE_LIMIT = 1_000_000


@dataclass(frozen=True, slots=True)
class ExpectedMiss:
    """The expected weight of the elements that a plan within the budget misses.

    Parameters
    ----------
    budget
        Most that the plan may cost.
    weights
        What each element is worth, or None for 1 each.
    """

    budget: float
    weights: tuple[float, ...] | None = None

    def evaluate(self, instance: Instance, chosen: Sequence[int], number: Callable[[float], Number]) -> Evidence:
        """Expected missed weight; by how much the budget is overspent."""
        zero = number(0.0)
        missed = zero
        for weight, miss in zip(element_weights(self.weights, instance), failures(instance, chosen, number), strict=True):
            missed = missed + number(float(weight)) * miss
        over = max(zero, total_cost(instance, chosen, number) - number(float(self.budget)))
        return Evidence(value=(missed,), shortfall=(over,))

    def missing(self, instance: Instance, chosen: Sequence[int]) -> list[Sequence[int]]:
        """None: a plan falls short by costing too much, which no further candidate mends."""
        return []


@dataclass(frozen=True, slots=True)
class Budgeted:
    """Least expected missed weight within a budget, by tangents to exp(-s).

    Parameters
    ----------
    budget
        Most that the plan may cost, at least 0.
    weights
        What each element is worth, at least 0 and one an element; None for 1 each.
    tolerance
        By how much the model's objective may lie below the expected missed weight, in the same unit.

    Examples
    --------
    >>> instance = Instance.of([[0.9, 0.0, 0.6], [0.0, 0.8, 0.6]])
    >>> Budgeted(budget=1.0).goal.evaluate(instance, [2], float).value
    (0.8,)
    """

    budget: float = 10.0
    weights: tuple[float, ...] | None = None
    tolerance: float = 1e-3

    name: ClassVar[str] = "budgeted"
    relation: ClassVar[Relation] = Relation.RELAXATION

    def __post_init__(self) -> None:
        expect("budget", 0 <= self.budget < math.inf, "a finite number of at least 0", self.budget)
        expect("tolerance", 0 < self.tolerance < math.inf, "a positive number", self.tolerance)
        for j, weight in enumerate(self.weights or ()):
            expect(f"weights[{j}]", 0 <= weight < math.inf, "a finite number of at least 0", weight)
        expect("weights", sum(self.weights or ()) < math.inf, "numbers with a finite sum", self.weights)

    @property
    def goal(self) -> Goal:
        """Least expected missed weight within the budget."""
        return ExpectedMiss(self.budget, self.weights)

    def lines(self, instance: Instance) -> Lines:
        """The tangents to exp(-s) that every element of the instance gets.

        Raises
        ------
        Refused
            If they would make more than `LINE_LIMIT` rows.
        """
        total = float(element_weights(self.weights, instance).sum())
        error = self.tolerance / total if total > 0 else 1.0
        rows = instance.elements * (2 + 0.72 / math.sqrt(error))
        if rows > LINE_LIMIT:
            raise Refused(f"tolerance {self.tolerance!r} takes about {rows:.0f} tangents, above {LINE_LIMIT}: raise it")
        return tangents(EXPONENTIAL, 0.0, max(1.0, -math.log(error)), error)

    def build(self, instance: Instance) -> Model:
        """Minimise the expected missed weight, from below, over tangents, the budget and clique rows.

        Raises
        ------
        InvalidSettings
            If there is not one weight an element.
        Refused
            If the tolerance takes more than `LINE_LIMIT` tangents.
        """
        n, m, cliques = instance.candidates, instance.elements, len(instance.conflicts)
        lines = self.lines(instance)
        on_s, on_y, height = lines.rows(m)
        weights = capped_rows(instance, np.arange(m), lines.cap)
        blocks = [
            [weights, -eye_array(m, format="csr"), None],
            [None, on_s, on_y],
            [csr_array(instance.cost[None, :]), None, None],
            [conflict_rows(instance), None, None],
        ]
        return Model(
            c=np.concatenate([np.zeros(n + m), element_weights(self.weights, instance)]),
            A=csr_array(block_array(blocks, format="csr")),
            lo=np.concatenate([np.zeros(m), height, bounds((1 + cliques, -np.inf))]),
            hi=bounds((m + len(height), np.inf), (1, self.budget), (cliques, 1.0)),
            ub=bounds((n, 1.0), (m, lines.cap), (m, 1.0)),
            integer=leading(n, n + 2 * m),
            candidates=n,
        )


def element_weights(weights: tuple[float, ...] | None, instance: Instance) -> NDArray[np.float64]:
    """What each element is worth, shape (elements,).

    Raises
    ------
    InvalidSettings
        If there is not one weight an element.
    """
    if weights is None:
        return np.ones(instance.elements)
    if len(weights) != instance.elements:
        raise InvalidSettings(f"weights: expected {instance.elements}, one an element, got {len(weights)}")
    return np.array(weights, dtype=np.float64)


formulation = Budgeted
