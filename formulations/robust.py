r"""Probabilities known only up to a deviation: the cheapest plan that survives the worst few of them.

**Data.** Every $p_{ij}$ may turn out as low as $\max(0, p_{ij} - d)$; in each row at most $\Gamma$ of the chosen
candidates deviate, whichever hurt most. $b_j = -\log(1 - q_j)$; in units of $b_j$ the nominal and the worst weight of a
candidate, truncated at 1, are

$$N_{ij} = \min \Big( 1, \frac{-\log(1 - p_{ij})}{b_j} \Big), \qquad
W_{ij} = \min \Big( 1, \frac{-\log(1 - \max(0, p_{ij} - d))}{b_j} \Big), \qquad D_{ij} = N_{ij} - W_{ij} \ge 0$$

**Variables.** $x_i \in \lbrace 0, 1 \rbrace$: candidate $i$ is in the plan; $z_j, r_{ij} \ge 0$: duals of the
adversary.

$$\min \sum_i c_i x_i \quad \text{s.t.} \quad \sum_i N_{ij} x_i - \Gamma z_j - \sum_i r_{ij} \ge 1 \quad \forall j: q_j > 0,
\qquad z_j + r_{ij} \ge D_{ij} x_i \quad \forall i, j, \qquad \sum_{i \in Q} x_i \le 1 \quad \forall Q$$

In rows of which at most $\Gamma$ candidates can deviate, all may: there $W$ takes the place of $N$ and no dual is
needed; with $\Gamma = 0$ only $N$ is left.

**Why it is exact.** For a plan $S$ and a set $A \subseteq S$ of at most $\Gamma$ deviating candidates the row asks for
$\sum_{S \setminus A} N_{ij} + \sum_A W_{ij} \ge 1$. Non-negative numbers $v_i$ satisfy $\sum_i \min(1, v_i) \ge 1$
exactly when $\sum_i v_i \ge 1$: either some $v_i \ge 1$ and both hold, or truncation changes nothing. So for each $A$
the truncated row holds exactly when the untruncated one does, and hence so do the rows for the worst $A$, even though
truncation may change which $A$ that is. The adversary's problem, $\max \sum_i D_{ij} x_i u_i$ over $0 \le u_i \le 1$,
$\sum_i u_i \le \Gamma$, has integer corners; $z_j$ and $r_{ij}$ are its dual.

- **Relation:** exact, for the worst case.
- **Size:** let $k$ count the stored $p_{ij}$ with $D_{ij} > 0$ in the $m_\Gamma$ rows that have more than
  $\Gamma \ge 1$ of them: $n + m_\Gamma + k$ variables; $m_+ + k + |Q|$ rows, $m_+$ the elements with $q_j > 0$;
  $4 k + m_\Gamma$ non-zeros, and one for each positive weight of those elements and each clique member.
- **Use it** when the predictor was fitted to few grasps: `gamma=1` guards each element against one overrated candidate.
  Unlike lowering all probabilities by $d$ (a large `gamma`) it does not pay for all errors at once.
- **Source:** Bertsimas and Sim 2004 (The price of robustness), applied to the rows of Adler et al. 2023, Eq. 2.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_array, coo_array, csr_array, eye_array

from pscover.formulation import Relation
from pscover.goal import Evidence, Goal, Number, total_cost
from pscover.instance import TOLERANCE, Instance
from pscover.model import Model

from ._shared import bounds, conflict_rows, expect, leading, required_elements, unchosen

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class WorstCase:
    """The cheapest plan whose requirements hold when in each row up to `gamma` candidates lose `deviation`."""

    deviation: float
    gamma: int

    def evaluate(self, instance: Instance, chosen: Sequence[int], number: Callable[[float], Number]) -> Evidence:
        """Cost; q_j minus the worst-case coverage, where positive, for each element.

        The product of misses is largest when the `gamma` candidates with the largest ratio of worst to nominal miss
        deviate; where p_ij = 1 that ratio is infinite.
        """
        zero, lost = number(0.0), number(float(self.deviation))
        p = instance.probability
        nominal: list[list[Number]] = [[] for _ in range(instance.elements)]
        for i in chosen:
            for k in range(p.indptr[i], p.indptr[i + 1]):
                nominal[p.indices[k]].append(1 - number(float(p.data[k])))
        short = []
        for q, misses in zip(instance.required, nominal, strict=True):
            miss = _worst_miss(misses, lost, self.gamma, number)
            short.append(max(zero, number(float(q)) - (1 - miss)))
        return Evidence(value=(total_cost(instance, chosen, number),), shortfall=tuple(short))

    def missing(self, instance: Instance, chosen: Sequence[int]) -> list[Sequence[int]]:
        """For each element that falls short, the candidates that cover it and are not chosen: more never hurts."""
        shortfall = self.evaluate(instance, chosen, float).shortfall
        return unchosen(instance, [j for j, missing in enumerate(shortfall) if missing > TOLERANCE], chosen)


def _worst_miss(nominal: list[Number], lost: Number, gamma: int, number: Callable[[float], Number]) -> Number:
    """The largest product of misses when at most `gamma` of the candidates deviate."""
    one = number(1.0)
    # Certain candidates come first: any of them left nominal makes the product 0, so none can be spared.
    certain = [(miss, min(one, miss + lost)) for miss in nominal if miss == 0]
    others = [(miss, min(one, miss + lost)) for miss in nominal if miss > 0]
    others.sort(key=lambda pair: pair[1] / pair[0], reverse=True)
    product = one
    for place, (miss, worst) in enumerate(certain + others):
        product = product * (worst if place < gamma else miss)
    return product


@dataclass(frozen=True, slots=True)
class Robust:
    """Cheapest plan that holds when up to `gamma` candidates in each row are worse than predicted.

    Parameters
    ----------
    deviation
        By how much a probability may be lower than predicted, in [0, 1].
    gamma
        How many of the chosen candidates may deviate in each row, at least 0.

    Examples
    --------
    >>> instance = Instance.of([[0.8, 0.5, 0.6]], required=0.78)
    >>> [Robust(gamma=1).goal.evaluate(instance, plan, float).is_feasible for plan in ([0], [1, 2], [0, 1])]
    [False, False, True]
    """

    deviation: float = 0.1
    gamma: int = 1

    name: ClassVar[str] = "robust"
    relation: ClassVar[Relation] = Relation.EXACT
    tolerance: ClassVar[float] = 0.0

    def __post_init__(self) -> None:
        expect("deviation", 0 <= self.deviation <= 1, "a probability in [0, 1]", self.deviation)
        expect("gamma", self.gamma >= 0, "a whole number of at least 0", self.gamma)

    @property
    def goal(self) -> Goal:
        """The cheapest plan that meets every requirement in the worst case."""
        return WorstCase(self.deviation, self.gamma)

    def build(self, instance: Instance) -> Model:
        """Minimise cost over robust covering rows and clique rows."""
        elements, packing = required_elements(instance), conflict_rows(instance)
        n, rows, cliques = instance.candidates, len(elements), packing.shape[0]
        owner, column, nominal, worst = self._weights(instance, elements)
        drop = nominal - worst
        able = np.bincount(owner[drop > 0], minlength=rows)
        guarded = (self.gamma > 0) & (able > self.gamma)
        dual = np.flatnonzero(guarded[owner] & (drop > 0))
        plain = nominal if self.gamma == 0 else np.where(guarded[owner], nominal, worst)
        cover = csr_array(coo_array((plain, (owner, column)), shape=(rows, n)))
        cover.eliminate_zeros()
        # Rows are guarded where fewer than all candidates deviate; beyond that a float may not hold gamma.
        budget = csr_array(float(min(self.gamma, n)) * eye_array(rows, format="csr")[:, np.flatnonzero(guarded)])
        number = np.cumsum(guarded) - 1
        k, each = len(dual), np.arange(len(dual))
        share = csr_array(coo_array((np.ones(k), (owner[dual], each)), shape=(rows, k)))
        level = csr_array(coo_array((np.ones(k), (each, number[owner[dual]])), shape=(k, int(guarded.sum()))))
        taken = csr_array(coo_array((drop[dual], (each, column[dual])), shape=(k, n)))
        blocks = [[cover, -budget, -share], [-taken, level, eye_array(k, format="csr")], [packing, None, None]]
        duals = level.shape[1] + k
        return Model(
            c=np.concatenate([instance.cost, np.zeros(duals)]),
            A=csr_array(block_array(blocks, format="csr")),
            lo=bounds((rows, 1.0), (k, 0.0), (cliques, -np.inf)),
            hi=bounds((rows + k, np.inf), (cliques, 1.0)),
            ub=np.concatenate([np.ones(n + level.shape[1]), drop[dual]]),
            integer=leading(n, n + duals),
            candidates=n,
        )

    def _weights(
        self, instance: Instance, elements: NDArray[np.intp]
    ) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray, FloatArray]:
        """Row, column, N and W of every stored probability of the elements."""
        entries = csr_array(csr_array(instance.probability)[elements]).tocoo()
        owner, column = entries.row.astype(np.intp), entries.col.astype(np.intp)
        demand = instance.log_demand()[elements][owner]
        with np.errstate(divide="ignore"):
            nominal = -np.log1p(-entries.data)
            worst = -np.log1p(-np.maximum(entries.data - self.deviation, 0.0))
        return owner, column, np.minimum(1.0, nominal / demand), np.minimum(1.0, worst / demand)


formulation = Robust
