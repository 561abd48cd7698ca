"""Lower bounds that anyone can check: prices from which a bound follows in exact arithmetic, without a solver.

**Relaxation.** A plan S that the goal accepts has prod_{i in S} (1 - p_ij) <= r_j with r_j = 1 - q_j + `SLACK`, so that with
a_ij = -log(1 - p_ij) and d_j = -log r_j > 0 it has sum_{i in S} a_ij >= d_j. With U units a demand and whole sizes
s_ij >= U a_ij / d_j, cut off at U, every such plan has sum_{i in S} s_ij >= U. The sizes come from `decimal`; its logarithm
is correctly rounded, and every rounding is outward. Elements with r_j >= 1 ask for nothing. As S holds at most one candidate
of every clique, it holds at most one of each *group*, where a candidate's group is the largest of its cliques.

**Bound of prices.** Let z_ij and y_j be any numbers: what element j pays for candidate i, and what it pays for a unit.
For every plan S

    c(S) = sum_j [ sum_{i in S} z_ij + y_j sum_{i in S} s_ij ] + sum_{i in S} (c_i - sum_j (z_ij + y_j s_ij))
        >= sum_j [ least price of choices that meet row j ] + sum_j y_j U  (where y_j >= 0)
           + sum over groups min(0, least of what its candidates have left).

The least price of a row alone, over choices of at most one candidate a group, is a dynamic programme over units (Lagrangian
decomposition by rows: Guignard and Kim 1987), or one over levels of prices, rounded down, with sizes in much finer units:
both bound it, and the larger counts. It is at least what any valid inequality of that row proves: knapsack-cover,
cardinality and group-cover inequalities are prices of this kind. Prices are whole numbers of 1/`scale`, and costs are
rounded down to such, so that all of this is arithmetic of whole numbers.

**Splits.** A plan holds at most k of the candidates of element j, or at least k + 1. Each side has prices of its own and the
row of j is solved with so many candidates only; candidates that cannot be among k that meet the row are left out. The bound
of a split is the lower of the two.

**Parts.** Elements are divided among parts (one may be in several, or in none). Part k charges each candidate a c_i^k of any
sign; what is left is l_i = c_i - sum_k c_i^k. Every plan meets the elements of each part, so that, where B_k bounds the cost
at charges c^k of all choices that do,

    c(S) = sum_k c^k(S) + l(S) >= sum_k B_k + sum over groups min(0, least of what is left of its candidates).

Each B_k has a proof of its own, and is *lifted*: c^k(S) is a multiple of the greatest common divisor of the charges. That is
how independent blocks, whose bounds are 1.4 and 1.3 grasps, are known to take four.

**Sweeps.** Prices z_ij bound partial plans as they do whole ones: a plan that takes the choices T from some groups, and the
others from the rest, costs at least c(T) + sum_j [least price of choices from the rest that give j what T does not] + sum
over the rest's groups min(0, least of what its candidates have left). Let partial plans go from group to group, with every
choice from each that leaves at most one candidate in every clique, and follow all but those whose bound is at least the
limit: then every plan comes to the end, or one that begins it has a bound of at most its cost. A candidate may be left out
where another of its group is as large in all elements, not dearer, and in no other clique that other groups share. A partial
plan may be left out where another needs no more of any element, is not dearer and has no candidate of such a clique that the
first has none of: what completes the one completes the other. The bound is the least of the bounds of those that are not
followed and the costs of those that come to the end; if there are none, there is no plan. A sweep that would take too much
work ends early: the partial plans at hand then count by their bounds.

**Lift.** All costs of plans are multiples of the greatest common divisor of the candidates' costs (exact rationals): the
bound is rounded up to one.

No number in a certificate can make the bound exceed the cost of a plan: wrong prices make it weak, not wrong.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import reduce

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from pscover.errors import InvalidResult
from pscover.instance import Instance
from pscover.proof import Part, Parts, Prices, Proof, Split, Sweep, check
from pscover.relaxation import MOST_UNITS, Limits, Rows, gain
from pscover.sweeping import MOST_WORK, Effort, swept

LongArray = NDArray[np.int64]

MOST_SCALE = 2**40


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Certificate:
    """A lower bound on the cost of every plan, as data that prove it; see `certified_bound`.

    Parameters
    ----------
    units
        Into how many units each demand is divided, from 1 to 4096.
    scale
        Prices are whole numbers of 1/scale, from 1 to 2^40.
    proof
        Prices, a sweep, or splits and parts down to these.
    """

    units: int
    scale: int
    proof: Proof

    def over(self, instance: Instance) -> Certificate | None:
        """The same for an instance of which it numbers only the elements that ask for anything; None if it cannot be.

        That is how models number their covering rows.
        """
        elements = np.flatnonzero(instance.required > 0)
        entries = np.flatnonzero(np.isin(instance.probability.indices, elements))
        try:
            proof = _spread(self.proof, elements, entries, instance)
        except (IndexError, ValueError):
            return None
        return replace(self, proof=proof)

    def times(self, unit: float) -> Certificate | None:
        """The same for costs divided by a whole number; None where that is too large."""
        scale = Fraction(unit) * self.scale
        return replace(self, scale=int(scale)) if scale.denominator == 1 and 1 <= scale <= MOST_SCALE else None

    @property
    def leaves(self) -> int:
        """How many prices and sweeps it holds: 1 without splits and parts."""
        count, stack = 0, [self.proof]
        while stack:
            proof = stack.pop()
            if isinstance(proof, Split):
                stack += [proof.few, proof.many]
            elif isinstance(proof, Parts):
                stack += [part.proof for part in proof.parts]
            else:
                count += 1
        return count


def certified_bound(instance: Instance, certificate: Certificate) -> Fraction | float:
    """The lower bound that a certificate proves: no plan that meets every requirement to within `SLACK` costs less.

    Parameters
    ----------
    instance
        The problem.
    certificate
        Not to be trusted: any numbers in it give a bound that holds.

    Returns
    -------
    Fraction or float
        Exact; plus infinity where the certificate proves that there is no plan.

    Raises
    ------
    InvalidResult
        If the certificate is not one of an instance of this size, or its numbers are too large.

    Examples
    --------
    >>> instance = Instance.of([[0.5, 0.5, 0.5], [0.0, 0.6, 0.6]], required=[0.7, 0.5])
    >>> prices = Prices(entry=np.array([2, 2, 0, 2, 0]), unit=np.zeros(2, dtype=np.int64))
    >>> certified_bound(instance, Certificate(units=10, scale=2, proof=prices))
    Fraction(2, 1)
    """
    _check(instance, certificate)
    rows = Rows.of(instance, certificate.units, certificate.scale)
    least = _least(rows, certificate.proof, {}, Effort(MOST_WORK))
    if least is None:
        return math.inf
    bound = Fraction(least, certificate.scale)
    step = common_step(instance)
    return bound if step == 0 else math.ceil(bound / step) * step


def common_step(instance: Instance) -> Fraction:
    """The greatest common divisor of the costs, as rational numbers; 0 without candidates.

    Examples
    --------
    >>> common_step(Instance.of([[0.5, 0.5]], cost=[1.5, 2.5]))
    Fraction(1, 2)
    """
    costs = [Fraction(c) for c in np.unique(instance.cost).tolist()]
    bottom = math.lcm(*(c.denominator for c in costs))
    return Fraction(reduce(math.gcd, (c.numerator * (bottom // c.denominator) for c in costs), 0), bottom)


def refutation(W: csr_array, choices: Sequence[Sequence[int]]) -> Certificate:
    """A certificate that no plan meets the covering rows of some choice, if that can be seen from a sweep in their order.

    Examples
    --------
    >>> instance = Instance.of([[0.5, 0.5, 0.9], [0.5, 0.5, 0.0]], required=0.7, conflicts=[(0, 1)])
    >>> certified_bound(instance, refutation(instance.probability.tocsr(), [[1]]))
    inf
    """
    parts = []
    for rows in choices:
        order = np.array(rows, dtype=np.int64)
        entries = np.concatenate([W.indices[W.indptr[j] : W.indptr[j + 1]] for j in order]).astype(np.int64)
        charged = np.unique(entries)
        sweep = Sweep(entry=np.zeros(len(entries), dtype=np.int64), order=order, limit=None)
        # Free candidates: whatever needs no more of any element replaces the rest.
        free = np.zeros(len(charged), dtype=np.int64)
        parts.append(Part(elements=np.sort(order), charged=charged, charge=free, proof=sweep))
    return Certificate(units=1, scale=1, proof=Parts(parts=tuple(parts)))


def _spread(proof: Proof, elements: LongArray, entries: LongArray, instance: Instance) -> Proof:
    """A proof about some elements and entries as one about all; raises ValueError or IndexError where the numbers differ."""
    if isinstance(proof, Parts):
        return Parts(parts=tuple(_spread_part(part, elements) for part in proof.parts))
    if isinstance(proof, Split):
        few, many = (_spread(side, elements, entries, instance) for side in (proof.few, proof.many))
        return replace(proof, element=int(elements[proof.element]), few=few, many=many)
    entry = np.zeros(instance.probability.nnz, dtype=np.int64)
    entry[entries] = proof.entry
    if isinstance(proof, Sweep):
        others = np.setdiff1d(np.arange(instance.elements), elements)
        return replace(proof, entry=entry, order=np.concatenate((elements[proof.order], others)))
    unit = np.zeros(instance.elements, dtype=np.int64)
    unit[elements] = proof.unit
    return Prices(entry=entry, unit=unit)


def _spread_part(part: Part, elements: LongArray) -> Part:
    """A part has numbers for its own entries only, which stay the same."""
    return replace(part, elements=elements[part.elements], proof=_renumbered(part.proof, elements))


def _renumbered(proof: Proof, elements: LongArray) -> Proof:
    if isinstance(proof, Parts):
        return Parts(parts=tuple(_spread_part(part, elements) for part in proof.parts))
    if isinstance(proof, Split):
        few, many = (_renumbered(side, elements) for side in (proof.few, proof.many))
        return replace(proof, element=int(elements[proof.element]), few=few, many=many)
    return replace(proof, order=elements[proof.order]) if isinstance(proof, Sweep) else proof


def _check(instance: Instance, certificate: Certificate) -> None:
    if not isinstance(certificate, Certificate):
        raise InvalidResult(f"certificate: expected a Certificate, got {type(certificate).__name__}")
    for name, value, most in (("units", certificate.units, MOST_UNITS), ("scale", certificate.scale, MOST_SCALE)):
        if not isinstance(value, int) or not 1 <= value <= most:
            raise InvalidResult(f"certificate: {name}: expected a whole number from 1 to {most}, got {value!r}")
    check(certificate.proof, instance, certificate.units)


def _least(rows: Rows, proof: Proof, limits: Limits, effort: Effort) -> int | None:
    """The bound of what meets all rows within limits, in 1/scale; None where nothing does."""
    if isinstance(proof, Prices):
        return rows.bound(proof, limits)
    if isinstance(proof, Sweep):
        return swept(rows, proof, effort)
    if isinstance(proof, Parts):
        return _sum(rows, proof, limits, effort)
    element = int(np.searchsorted(rows.elements, proof.element))
    low, high = limits.get(element, (0, None))
    few = {**limits, element: (low, proof.count if high is None else min(high, proof.count))}
    many = {**limits, element: (max(low, proof.count + 1), high)}
    found = [_least(rows, proof.few, few, effort), _least(rows, proof.many, many, effort)]
    return min((bound for bound in found if bound is not None), default=None)


def _sum(rows: Rows, proof: Parts, limits: Limits, effort: Effort) -> int | None:
    """The bounds of all parts, lifted, and what is left of costs."""
    order = np.argsort(rows.row, kind="stable")
    starts = np.searchsorted(rows.row[order], np.arange(len(rows.elements) + 1))
    left, total = rows.cost.copy(), 0
    for part in proof.parts:
        which = np.searchsorted(rows.elements, part.elements)
        entries = np.sort(np.concatenate([order[starts[j] : starts[j + 1]] for j in which.tolist()]))
        own, some = rows.part(which, entries)
        charge = left[some]
        at = np.searchsorted(own.candidates, part.charged)
        if (at == len(some)).any() or (own.candidates[at] != part.charged).any():
            raise InvalidResult("certificate: parts: expected charges for candidates that cover an element of the part")
        charge[at] = part.charge
        left[some] -= charge
        inner = {k: limits[j] for k, j in enumerate(which.tolist()) if j in limits}
        bound = _least(replace(own, cost=charge), part.proof, inner, effort)
        if bound is None:
            return None
        step = int(np.gcd.reduce(charge)) if len(charge) else 0
        total += bound if step == 0 else -(-bound // step) * step
    return total + gain(left, rows.group)
