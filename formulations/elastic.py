r"""Never infeasible: as few unmet requirements as possible, then as little shortfall, then as little cost.

**Data.** $w_{ij} = \min(1, a_{ij} / b_j)$ with $a_{ij} = -\log(1 - p_{ij})$, $b_j = -\log(1 - q_j)$; cliques $Q$ of
candidates that exclude each other; $J$ the elements with $q_j > 0$.

**Variables.** $x_i \in \lbrace 0, 1 \rbrace$: candidate $i$ is in the plan; $y_j \in \lbrace 0, 1 \rbrace$: requirement
$j$ may stay unmet; $u_j \in [0, 1]$: its shortfall.

$$\text{lexmin} \Big( \sum_{j \in J} y_j, \quad \sum_{j \in J} u_j, \quad \sum_i c_i x_i \Big) \quad \text{s.t.} \quad
\sum_i w_{ij} x_i + u_j \ge 1, \quad u_j \le y_j \quad \forall j \in J,
\qquad \sum_{i \in Q} x_i \le 1 \quad \forall Q$$

The shortfall of an element is measured in relative log units, $u_j = (1 - \sum_i w_{ij} x_i)^+$: 0 when the requirement
is met, 1 when nothing covers the element, and one half when the chosen candidates would have to be doubled. With $f_j$
the probability that the plan misses $j$ it equals $1 - \log f_j / \log(1 - q_j)$ where that is positive: for binary $x$
truncation changes only met rows. The goal calls a requirement unmet when the coverage falls short by more than
$10^{-9}$.

- **Relation:** exact (and every conflict-free plan is feasible).
- **Size:** $n + 2 m_+$ variables, $m_+$ the elements with $q_j > 0$; $2 m_+ + |Q|$ rows; one non-zero for each stored
  $p_{ij}$ of those elements and each clique member, and $3 m_+$ more. Three runs of the engine, one an objective.
- **Use it** when `clique` says infeasible and a plan is needed all the same: it shows which requirements to give up.
- **Source:** elastic constraints and the fewest unmet of them: Chinneck 2008 (Feasibility and Infeasibility in
  Optimization); goals in order of priority: Charnes and Cooper 1961.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.sparse import block_array, csr_array, eye_array

from pscover.formulation import Relation
from pscover.goal import Evidence, Goal, Number, failures, total_cost
from pscover.instance import TOLERANCE, Instance
from pscover.model import Model

from ._shared import bounds, conflict_rows, covering_rows, leading


@dataclass(frozen=True, slots=True)
class FewestUnmet:
    """Unmet requirements, then their shortfall in relative log units, then cost; every plan is feasible."""

    def evaluate(self, instance: Instance, chosen: Sequence[int], number: Callable[[float], Number]) -> Evidence:
        """(How many unmet, sum of shortfalls, cost); no requirement binds. The logarithms are floats in any arithmetic."""
        missed = failures(instance, chosen, number)
        unmet, short = 0, 0.0
        for q, miss in zip(instance.required.tolist(), missed, strict=True):
            if number(q) - (1 - miss) > TOLERANCE:
                unmet += 1
                short += max(0.0, 1.0 - math.log(miss) / math.log1p(-q))
        return Evidence(value=(number(float(unmet)), number(short), total_cost(instance, chosen, number)), shortfall=())

    def missing(self, instance: Instance, chosen: Sequence[int]) -> list[Sequence[int]]:
        """None: no plan falls short."""
        return []


@dataclass(frozen=True, slots=True)
class Elastic:
    """Requirements that may stay unmet, at a price above every shortfall, itself above every cost."""

    name: ClassVar[str] = "elastic"
    relation: ClassVar[Relation] = Relation.EXACT
    tolerance: ClassVar[float] = 0.0
    goal: ClassVar[Goal] = FewestUnmet()

    def build(self, instance: Instance) -> Model:
        """Three objectives in order over elastic covering rows and clique rows."""
        cover, packing = covering_rows(instance), conflict_rows(instance)
        n, soft, cliques = instance.candidates, cover.shape[0], packing.shape[0]
        identity = eye_array(soft, format="csr")
        blocks = [[cover, None, identity], [None, identity, -identity], [packing, None, None]]
        return Model(
            c=bounds((n, 0.0), (soft, 1.0), (soft, 0.0)),
            A=csr_array(block_array(blocks, format="csr")),
            lo=bounds((soft, 1.0), (soft, 0.0), (cliques, -np.inf)),
            hi=bounds((2 * soft, np.inf), (cliques, 1.0)),
            ub=np.ones(n + 2 * soft),
            integer=leading(n + soft, n + 2 * soft),
            candidates=n,
            then=(bounds((n + soft, 0.0), (soft, 1.0)), np.concatenate([instance.cost, np.zeros(2 * soft)])),
        )


formulation = Elastic
