r"""Classical set cover: every element by one candidate that is good enough alone.

**Data.** $N_j = \lbrace i : p_{ij} \ge q_j \rbrace$, the candidates that meet the requirement of element $j$ without
help; cliques $Q$ of candidates that exclude each other.

**Variables.** $x_i \in \lbrace 0, 1 \rbrace$: candidate $i$ is in the plan.

$$\min \sum_i c_i x_i \quad \text{s.t.} \quad \sum_{i \in N_j} x_i \ge 1 \quad \forall j: q_j > 0,
\qquad \sum_{i \in Q} x_i \le 1 \quad \forall Q$$

Every plan of this model is a plan of the problem, as $1 - \prod_i (1 - p_{ij}) \ge p_{kj} \ge q_j$ for any chosen
$k \in N_j$. The converse fails: two candidates of 0.6 each reach 0.84 together.

- **Relation:** restriction. Its optimum is an upper bound; that it is infeasible proves nothing.
- **Size:** $n$ variables; $m_+ + |Q|$ rows, $m_+$ the elements with $q_j > 0$; one non-zero for each $p_{ij} \ge q_j$
  of those elements and each clique member.
- **Use it** for a quick plan from a purely combinatorial model, to measure what adding up probabilities saves, and for
  instances of deterministic set cover ($p_{ij} = 1$), where nothing is lost.
- **Source:** Karp 1972 for set cover; the threshold rule is how uncertain coverage is reduced to it when candidates are
  not combined (Toregas, Swain, ReVelle, Bergman 1971 use a distance in the place of $p_{ij}$).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.sparse import csr_array, vstack

from pscover.formulation import Relation
from pscover.goal import Cover, Goal
from pscover.instance import Instance
from pscover.model import Model

from ._shared import binaries, bounds, conflict_rows, required_elements


@dataclass(frozen=True, slots=True)
class SingleCover:
    """One candidate with p_ij >= q_j for each element; one packing row a clique."""

    name: ClassVar[str] = "single_cover"
    relation: ClassVar[Relation] = Relation.RESTRICTION
    tolerance: ClassVar[float] = 0.0
    goal: ClassVar[Goal] = Cover()

    def build(self, instance: Instance) -> Model:
        """Minimise cost over set-cover rows and clique rows."""
        cover, packing = _sufficient(instance), conflict_rows(instance)
        return Model(
            c=instance.cost,
            A=csr_array(vstack([cover, packing], format="csr")),
            lo=bounds((cover.shape[0], 1.0), (packing.shape[0], -np.inf)),
            hi=bounds((cover.shape[0], np.inf), (packing.shape[0], 1.0)),
            ub=np.ones(instance.candidates),
            integer=binaries(instance.candidates),
            candidates=instance.candidates,
        )


def _sufficient(instance: Instance) -> csr_array:
    """Ones where p_ij >= q_j > 0, shape (elements with q_j > 0, candidates)."""
    elements = required_elements(instance)
    p = csr_array(csr_array(instance.probability)[elements])
    required = np.repeat(instance.required[elements], np.diff(p.indptr))
    rows = csr_array(((p.data >= required).astype(np.float64), p.indices, p.indptr), shape=p.shape)
    rows.eliminate_zeros()
    return rows


formulation = SingleCover
