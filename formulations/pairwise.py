r"""The paper's model to the letter: logarithms as they are, one row for each conflicting pair.

**Data.** $p_{ij}$ the probability that candidate $i$ covers element $j$, $q_j$ the required probability, $C$ the pairs
of candidates that exclude each other.

**Variables.** $x_i \in \lbrace 0, 1 \rbrace$: candidate $i$ is in the plan.

$$\min \sum_i c_i x_i \quad \text{s.t.} \quad \sum_i x_i \log(1 - p_{ij}) \le \log(1 - q_j) \quad \forall j,
\qquad x_i + x_k \le 1 \quad \forall (i, k) \in C$$

The paper assumes $p_{ij} < 1$. Where $p_{ij} = 1$ the coefficient, minus infinity there, is replaced by
$\log(1 - q_j)$: that candidate alone meets the requirement, with or without others, so the same plans remain.

- **Relation:** exact.
- **Size:** $n$ variables; $m + |C|$ rows, $m$ the elements; one non-zero for each stored $p_{ij}$ (none where
  $p_{ij} = 1$ and $q_j = 0$) and two for each pair. A clique of 30 candidates makes 435 pairs; above 20 million pairs
  it is refused.
- **Use it** to reproduce the paper, and as the yardstick for `clique`, whose linear relaxation is never weaker.
- **Source:** Adler et al. 2023 (arXiv 2310.16951), Eq. 2; there $c_i = 1$.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.sparse import csr_array, vstack

from pscover.errors import Refused
from pscover.formulation import Relation
from pscover.goal import Cover, Goal
from pscover.instance import Instance
from pscover.model import Model

from ._shared import binaries, bounds

PAIR_LIMIT = 20_000_000


@dataclass(frozen=True, slots=True)
class Pairwise:
    """Log-linear rows in the paper's signs and scale; one row for each conflicting pair."""

    name: ClassVar[str] = "pairwise"
    relation: ClassVar[Relation] = Relation.EXACT
    tolerance: ClassVar[float] = 0.0
    goal: ClassVar[Goal] = Cover()

    def build(self, instance: Instance) -> Model:
        """Minimise cost over the rows of Eq. 2.

        Raises
        ------
        Refused
            If the cliques hold more than `PAIR_LIMIT` pairs.
        """
        count = instance.conflicts.pair_count()
        if count > PAIR_LIMIT:
            raise Refused(f"{count} conflicting pairs exceed the limit of {PAIR_LIMIT}: take the formulation 'clique'")
        cover, packing = _log_rows(instance), _pair_rows(instance)
        demand = instance.log_demand()
        return Model(
            c=instance.cost,
            A=csr_array(vstack([cover, packing], format="csr")),
            lo=bounds((cover.shape[0] + packing.shape[0], -np.inf)),
            hi=np.concatenate([-demand, np.ones(packing.shape[0])]),
            ub=np.ones(instance.candidates),
            integer=binaries(instance.candidates),
            candidates=instance.candidates,
        )


def _log_rows(instance: Instance) -> csr_array:
    weights = csr_array(instance.log_weights())
    owner = np.repeat(np.arange(instance.elements), np.diff(weights.indptr))
    finite = np.where(np.isinf(weights.data), instance.log_demand()[owner], weights.data)
    rows = csr_array((-finite, weights.indices, weights.indptr), shape=weights.shape)
    rows.eliminate_zeros()
    return rows


def _pair_rows(instance: Instance) -> csr_array:
    pairs = instance.conflicts.pairs()
    starts = 2 * np.arange(len(pairs) + 1, dtype=np.int32)
    return csr_array((np.ones(pairs.size), pairs.ravel(), starts), shape=(len(pairs), instance.candidates))


formulation = Pairwise
