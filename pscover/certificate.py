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
decomposition by rows: Guignard and Kim 1987). It is at least what any valid inequality of that row proves: knapsack-cover,
cardinality and group-cover inequalities are prices of this kind. Prices are whole numbers of 1/`scale`, and costs are
rounded down to such, so that all of this is arithmetic of whole numbers.

**Splits.** A plan holds at most k of the candidates of element j, or at least k + 1. Each part has prices of its own and the
row of j is solved with so many candidates only; candidates that cannot be among k that meet the row are left out. The bound
of a split is the lower of the two.

**Lift.** All costs of plans are multiples of the greatest common divisor of the candidates' costs (exact rationals): the
bound is rounded up to one.

No number in a certificate can make the bound exceed the cost of a plan: wrong prices make it weak, not wrong.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidResult
from pscover.instance import Instance
from pscover.relaxation import HUGE, MOST_UNITS, Rows

LongArray = NDArray[np.int64]

MOST_SCALE = 2**40
MOST_DEPTH = 100
"""Splits within splits; deeper certificates are refused."""
MOST_COUNT = 16
"""Candidates that a split counts at most: they are a dimension of the dynamic programme."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prices:
    """What elements pay: a bound without splits.

    Parameters
    ----------
    entry
        What each element pays for each candidate, in 1/scale, shape (entries of `Instance.probability`,), in its order.
    unit
        What each element pays for a unit of its demand, in 1/scale, at least 0, shape (elements,).
    """

    entry: LongArray
    unit: LongArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Split:
    """Two parts: plans with at most `count` of the candidates of an element, and plans with more.

    Parameters
    ----------
    element
        Whose candidates are counted.
    count
        How many.
    few, many
        What proves the bound of each part.
    """

    element: int
    count: int
    few: Prices | Split
    many: Prices | Split


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
        Prices, or splits down to prices.
    """

    units: int
    scale: int
    proof: Prices | Split

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
        """How many prices it holds: 1 without splits."""
        count, stack = 0, [self.proof]
        while stack:
            part = stack.pop()
            if isinstance(part, Split):
                stack += [part.few, part.many]
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
    rows = Rows(instance, certificate.units, certificate.scale)
    least = _least(rows, certificate.proof, {}, 0)
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


def _spread(proof: Prices | Split, elements: LongArray, entries: LongArray, instance: Instance) -> Prices | Split:
    """Prices of some elements and entries as prices of all; raises ValueError or IndexError where the numbers differ."""
    if isinstance(proof, Split):
        few, many = (_spread(part, elements, entries, instance) for part in (proof.few, proof.many))
        return replace(proof, element=int(elements[proof.element]), few=few, many=many)
    entry = np.zeros(instance.probability.nnz, dtype=np.int64)
    unit = np.zeros(instance.elements, dtype=np.int64)
    entry[entries], unit[elements] = proof.entry, proof.unit
    return Prices(entry=entry, unit=unit)


def _check(instance: Instance, certificate: Certificate) -> None:
    if not isinstance(certificate, Certificate):
        raise InvalidResult(f"certificate: expected a Certificate, got {type(certificate).__name__}")
    for name, value, most in (("units", certificate.units, MOST_UNITS), ("scale", certificate.scale, MOST_SCALE)):
        if not isinstance(value, int) or not 1 <= value <= most:
            raise InvalidResult(f"certificate: {name}: expected a whole number from 1 to {most}, got {value!r}")
    stack: list[tuple[Prices | Split, int]] = [(certificate.proof, 0)]
    while stack:
        part, depth = stack.pop()
        if isinstance(part, Prices):
            _check_prices(instance, part, certificate.units)
            continue
        if not isinstance(part, Split):
            raise InvalidResult(f"certificate: proof: expected Prices or a Split, got {type(part).__name__}")
        if depth >= MOST_DEPTH:
            raise InvalidResult(f"certificate: expected at most {MOST_DEPTH} splits within each other, got more")
        whole = isinstance(part.element, int) and isinstance(part.count, int)
        if not (whole and 0 <= part.element < instance.elements and 0 <= part.count <= MOST_COUNT):
            expected = f"an element below {instance.elements} and a count of at most {MOST_COUNT}"
            raise InvalidResult(f"certificate: split: expected {expected}, got {part.element!r} and {part.count!r}")
        stack += [(part.few, depth + 1), (part.many, depth + 1)]


def _check_prices(instance: Instance, prices: Prices, units: int) -> None:
    p = instance.probability
    for name, array, size in (("entry", prices.entry, p.nnz), ("unit", prices.unit, instance.elements)):
        if not isinstance(array, np.ndarray):
            raise InvalidResult(f"certificate: {name} prices: expected a NumPy array, got {type(array).__name__}")
        if array.dtype != np.int64 or array.shape != (size,):
            raise InvalidResult(
                f"certificate: {name} prices: expected {size} whole numbers, got {array.shape} of {array.dtype}"
            )
    if (prices.unit < 0).any():
        raise InvalidResult(f"certificate: unit prices: expected numbers of at least 0, got {int(prices.unit.min())}")
    # Sums of doubles are off by a tiny part: far less than the factor between HUGE and what would overflow.
    entry, unit = np.abs(prices.entry.astype(np.float64)), prices.unit.astype(np.float64)
    if entry.sum() + units * (unit[p.indices].sum() + unit.sum()) >= HUGE:
        raise InvalidResult("certificate: expected prices that add up to less than 2^59, got larger ones")


def _least(rows: Rows, proof: Prices | Split, limits: dict[int, tuple[int, int | None]], depth: int) -> int | None:
    """The bound of a part in 1/scale, None where it holds no plan; limits are the least and the most of each element."""
    if isinstance(proof, Prices):
        return rows.bound(proof, limits)
    low, high = limits.get(proof.element, (0, None))
    few = {**limits, proof.element: (low, proof.count if high is None else min(high, proof.count))}
    many = {**limits, proof.element: (max(low, proof.count + 1), high)}
    found = [_least(rows, proof.few, few, depth + 1), _least(rows, proof.many, many, depth + 1)]
    return min((bound for bound in found if bound is not None), default=None)
