r"""Conflicts as cliques, rows scaled and truncated: the default.

**Data.** $a_{ij} = -\log(1 - p_{ij})$, $b_j = -\log(1 - q_j)$, cliques $Q$ of candidates that exclude each other.

**Variables.** $x_i \in \lbrace 0, 1 \rbrace$: candidate $i$ is in the plan.

$$\min \sum_i c_i x_i \quad \text{s.t.} \quad \sum_i \min(1, a_{ij} / b_j) x_i \ge 1 \quad \forall j: q_j > 0,
\qquad \sum_{i \in Q} x_i \le 1 \quad \forall Q$$

Scaling makes an engine's absolute tolerance a relative shortfall; truncation is exact for binaries, tightens the linear
relaxation and keeps $p_{ij} = 1$ finite.

- **Relation:** exact.
- **Size:** $n$ variables; $m_+ + |Q|$ rows, $m_+$ the elements with $q_j > 0$; one non-zero for each stored $p_{ij}$ of
  those elements and each clique member.
- **Use it** always, unless another formulation says when it is better.
- **Source:** Adler et al. 2023 (arXiv 2310.16951), Eq. 2, for the log-linear rows; coefficient tightening: Savelsbergh
  1994 and Carr, Fleischer, Leung, Phillips 2000; clique rows: Padberg 1973.
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

from ._shared import binaries, bounds, conflict_rows, covering_rows


@dataclass(frozen=True, slots=True)
class Clique:
    """Covering rows scaled to a demand of 1 and truncated; one packing row a clique."""

    name: ClassVar[str] = "clique"
    relation: ClassVar[Relation] = Relation.EXACT
    tolerance: ClassVar[float] = 0.0
    goal: ClassVar[Goal] = Cover()

    def build(self, instance: Instance) -> Model:
        """Minimise cost over covering rows and clique rows."""
        cover, packing = covering_rows(instance), conflict_rows(instance)
        return Model(
            c=instance.cost,
            A=csr_array(vstack([cover, packing], format="csr")),
            lo=bounds((cover.shape[0], 1.0), (packing.shape[0], -np.inf)),
            hi=bounds((cover.shape[0], np.inf), (packing.shape[0], 1.0)),
            ub=np.ones(instance.candidates),
            integer=binaries(instance.candidates),
            candidates=instance.candidates,
        )


formulation = Clique
