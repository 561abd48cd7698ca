r"""The cheapest plan that covers all elements at once with a required probability.

**Data.** $a_{ij} = -\log(1 - p_{ij})$; $J$ the elements with $q_j > 0$, $m_+$ of them (how large $q_j$ is plays no
part); $R$ the probability required (`required`); cliques $Q$ of candidates that exclude each other.

**Variables.** $x_i \in \lbrace 0, 1 \rbrace$: candidate $i$ is in the plan; $s_j \in [0, L]$: log weight on element
$j$; $t_j \in [0, 1]$: the loss $g(s_j) = -\log(1 - e^{-s_j})$ of element $j$, in units of $T = -\log R$.

One candidate's successes on different elements count as independent, so that all are covered with probability
$\prod_j (1 - e^{-s_j})$, and that is at least $R$ exactly when $\sum_j g(s_j) \le T$. The function $g$ is convex and
falling (and its own inverse). Lines $\alpha_k - \beta_k s$ in its place give

$$\min \sum_i c_i x_i \quad \text{s.t.} \quad T t_j \ge \alpha_k - \beta_k s_j \quad \forall j, k,
\qquad s_j \le \sum_i \min(a_{ij}, L) x_i \quad \forall j,
\qquad \sum_j t_j \le \theta, \qquad \sum_{i \in Q} x_i \le 1 \quad \forall Q$$

No factor may fall below $R$, hence $s_j \ge \ell = -\log(1 - R)$; that is written as a covering row
$\sum_i \min(1, a_{ij} / \ell) x_i \ge 1$ for each element, exact for binaries.

**Side and error.** Let $\delta = \min(\log(1 + \text{precision} / R), T / 2)$ and $\varepsilon = 0.9 \delta / m_+$.
Breakpoints on $[\ell, g(\varepsilon)]$ keep every chord within $\varepsilon$ above $g$; beyond $g(\varepsilon)$ the
loss is at most $\varepsilon$.

- *Restriction* takes the chords, $L = g(\varepsilon)$, $\theta = 1 - 0.1 \delta / T$: losses are never too low, so
  every plan of the model reaches $R$, with room for an engine's own tolerance. They are too high by at most
  $0.9 \delta$ together, so every plan that reaches $R e^{\delta} \le R + \text{precision}$ is a plan of the model: it
  never costs more than the cheapest of those. Certain candidates ($p_{ij} = 1$) are charged $\varepsilon$ and are
  covered by the same bound.
- *Relaxation* takes the tangents parallel to the chords, $L$ where the last of them is 0, $\theta = 1$: losses are
  never too high, so every plan that reaches $R$ is a plan of the model, and its optimum is a lower bound. They are too
  low by at most $\varepsilon$ each, so every plan of the model reaches $R e^{-\delta} \ge R - \text{precision}$.
  Certain candidates are exact.

- **Relation:** restriction, or relaxation with `side="relaxation"`. The cost is exact for every plan.
- **Size:** $n + 2 m_+$ variables; $(K + 2) m_+ + 1 + |Q|$ rows; $(2 K + 2) m_+$ non-zeros, one for each clique member
  and two for each stored $p_{ij}$ of those elements; $K$ is about $-\log \tanh(\ell / 4) / \sqrt{8 \varepsilon}$.
  Refused when $K m_+$ exceeds a million. No rows but those of the cliques when $m_+ = 0$.
- **Use it** when one miss spoils the whole plan: the table must be clear, not each garment likely gone.
- **Source:** joint chance constraints: Miller and Wagner 1965, whose logarithm of the product this is; joint
  probabilistic set covering, with random right-hand sides: Beraldi and Ruszczynski 2002.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from scipy.sparse import block_array, csr_array, eye_array

from pscover.errors import Refused
from pscover.formulation import Relation
from pscover.goal import Evidence, Goal, Number, failures, total_cost
from pscover.instance import TOLERANCE, Instance
from pscover.model import Model

from ._convex import LOSS, Lines, secants, tangents
from ._shared import binaries, bounds, capped_rows, conflict_rows, expect, leading, required_elements, unchosen

LINE_LIMIT = 1_000_000
LEAST = 1e-9
"""Smallest R: the lines for less are too steep for any engine."""
APPROXIMATION = 0.9
"""Share of the precision that the lines may use; the rest is room for an engine's tolerance."""


@dataclass(frozen=True, slots=True)
class AllCovered:
    """The cheapest plan that covers all elements with q_j > 0 at once with probability `required`."""

    required: float

    def evaluate(self, instance: Instance, chosen: Sequence[int], number: Callable[[float], Number]) -> Evidence:
        """Cost; by how much the probability that all are covered falls short."""
        together = number(1.0)
        for q, miss in zip(instance.required, failures(instance, chosen, number), strict=True):
            if q > 0:
                together = together * (1 - miss)
        short = max(number(0.0), number(float(self.required)) - together)
        return Evidence(value=(total_cost(instance, chosen, number),), shortfall=(short,))

    def missing(self, instance: Instance, chosen: Sequence[int]) -> list[Sequence[int]]:
        """The unchosen candidates of all elements not yet certain; and of each element that alone is too uncertain."""
        if self.evaluate(instance, chosen, float).is_feasible:
            return []
        coverage, needed = instance.coverage(chosen), instance.required > 0
        open_elements = np.flatnonzero(needed & (coverage < 1))
        together = sorted({i for group in unchosen(instance, open_elements, chosen) for i in group})
        alone = np.flatnonzero(needed & (self.required - coverage > TOLERANCE))
        return [together, *unchosen(instance, alone, chosen)]


@dataclass(frozen=True, slots=True)
class Joint:
    """Cheapest plan that covers everything at once with a required probability, by lines around -log(1 - exp(-s)).

    Parameters
    ----------
    required
        Probability in [1e-9, 1) with which all elements with q_j > 0 must be covered together.
    precision
        Probability by which the model may be too strict (restriction) or too lax (relaxation).
    side
        Whether to err on the safe side (restriction) or to get a lower bound (relaxation).

    Examples
    --------
    >>> instance = Instance.of([[0.9, 0.0], [0.0, 0.9]], required=0.5)
    >>> [round(float(s), 2) for s in Joint(required=0.85).goal.evaluate(instance, [0, 1], float).shortfall]
    [0.04]
    """

    required: float = 0.7
    precision: float = 1e-3
    side: Literal["restriction", "relaxation"] = "restriction"

    name: ClassVar[str] = "joint"
    tolerance: ClassVar[float] = 0.0

    def __post_init__(self) -> None:
        expect("required", LEAST <= self.required < 1, f"a probability in [{LEAST:g}, 1)", self.required)
        expect("precision", 0 < self.precision <= 1, "a number in (0, 1]", self.precision)
        expect("side", self.side in ("restriction", "relaxation"), "'restriction' or 'relaxation'", self.side)

    @property
    def relation(self) -> Relation:
        """As `side` says."""
        return Relation(self.side)

    @property
    def goal(self) -> Goal:
        """The cheapest plan that covers all elements at once often enough."""
        return AllCovered(self.required)

    @property
    def budget(self) -> float:
        """T = -log R: what the losses of all elements may add up to."""
        return -math.log(self.required)

    @property
    def slack(self) -> float:
        """delta: by how much the sum of losses may be off."""
        return min(math.log1p(self.precision / self.required), 0.5 * self.budget)

    def lines(self, elements: int) -> Lines:
        """The lines in the place of the loss -log(1 - exp(-s)) when so many elements share the error.

        Raises
        ------
        Refused
            If they would make more than `LINE_LIMIT` rows.
        """
        error = APPROXIMATION * self.slack / max(elements, 1)
        start, stop = -math.log1p(-self.required), LOSS.value(error)
        rows = elements * (2 - 1.02 * math.log(math.tanh(start / 4)) / math.sqrt(8 * error))
        if rows > LINE_LIMIT:
            raise Refused(f"precision {self.precision!r} takes about {rows:.0f} lines, above {LINE_LIMIT}: raise it")
        return (secants if self.side == "restriction" else tangents)(LOSS, start, stop, error)

    def build(self, instance: Instance) -> Model:
        """Minimise cost over lines, the sum of losses, covering rows and clique rows.

        Raises
        ------
        Refused
            If the precision takes more than `LINE_LIMIT` lines.
        """
        elements, packing = required_elements(instance), conflict_rows(instance)
        n, m, cliques = instance.candidates, len(elements), packing.shape[0]
        if m == 0:
            return _unconstrained(instance)
        lines = self.lines(m)
        on_s, on_t, height = lines.rows(m, unit=self.budget)
        least = -math.log1p(-self.required)
        blocks = [
            [capped_rows(instance, elements, lines.cap), -eye_array(m, format="csr"), None],
            [None, on_s, on_t],
            [None, None, csr_array(np.ones((1, m)))],
            [capped_rows(instance, elements, least) / least, None, None],
            [packing, None, None],
        ]
        total = 1.0 - ((1 - APPROXIMATION) * self.slack / self.budget if self.side == "restriction" else 0.0)
        return Model(
            c=np.concatenate([instance.cost, np.zeros(2 * m)]),
            A=csr_array(block_array(blocks, format="csr")),
            lo=np.concatenate([np.zeros(m), height, bounds((1, -np.inf), (m, 1.0), (cliques, -np.inf))]),
            hi=bounds((m + len(height), np.inf), (1, total), (m, np.inf), (cliques, 1.0)),
            ub=bounds((n, 1.0), (m, lines.cap), (m, 1.0)),
            integer=leading(n, n + 2 * m),
            candidates=n,
        )


def _unconstrained(instance: Instance) -> Model:
    """Without required elements the empty product is 1: only the cliques remain."""
    packing = conflict_rows(instance)
    return Model(
        c=instance.cost,
        A=packing,
        lo=bounds((packing.shape[0], -np.inf)),
        hi=bounds((packing.shape[0], 1.0)),
        ub=np.ones(instance.candidates),
        integer=binaries(instance.candidates),
        candidates=instance.candidates,
    )


formulation = Joint
