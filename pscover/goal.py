"""What makes a plan good, stated apart from any linear model, so that every claim can be recomputed.

A goal evaluates a plan on an instance: its objectives in order of priority (all minimised) and by how much each of its
requirements is missed. The arithmetic is a parameter: `float` for a quick check, `fractions.Fraction` for an exact one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol, TypeVar, cast

import numpy as np

from pscover.instance import TOLERANCE, Instance

Number = TypeVar("Number", float, Fraction)


@dataclass(frozen=True, slots=True)
class Evidence:
    """What a plan is worth.

    Parameters
    ----------
    value
        Objectives in order of priority, all to be minimised.
    shortfall
        By how much each requirement of the goal is missed, >= 0.
    """

    value: tuple[float | Fraction, ...]
    shortfall: tuple[float | Fraction, ...]

    @property
    def is_feasible(self) -> bool:
        """Whether every requirement is met to within `pscover.instance.TOLERANCE`."""
        return all(missing <= TOLERANCE for missing in self.shortfall)


class Goal(Protocol):
    """A plan's worth. Conflicts are not part of a goal: they bind every plan."""

    def evaluate(self, instance: Instance, chosen: Sequence[int], number: Callable[[float], Number]) -> Evidence:
        """Objectives and shortfalls of a plan, in the arithmetic of `number` (`float` or `Fraction`)."""
        ...

    def missing(self, instance: Instance, chosen: Sequence[int]) -> list[Sequence[int]]:
        """For a plan that falls short: groups of candidates, each of which every feasible plan must hit.

        They are valid inequalities sum_{i in group} x_i >= 1, and cut the given plan off; an empty group proves that
        there is no feasible plan. Goals for which more candidates can hurt return none.
        """
        ...


def failures(instance: Instance, chosen: Sequence[int], number: Callable[[float], Number]) -> list[Number]:
    """prod_{i chosen} (1 - p_ij) for each element, in the arithmetic of `number`.

    Examples
    --------
    >>> failures(Instance.of([[0.5, 0.5]]), [0, 1], Fraction)
    [Fraction(1, 4)]
    """
    if number is float:
        # The same products by NumPy: plans of tens of thousands of candidates are weighed under a deadline.
        return cast(list[Number], (1.0 - instance.coverage(chosen)).tolist())
    one = number(1.0)
    missed = [one] * instance.elements
    p = instance.probability
    for i in chosen:
        for k in range(p.indptr[i], p.indptr[i + 1]):
            j = p.indices[k]
            missed[j] = missed[j] * (one - number(float(p.data[k])))
    return missed


def total_cost(instance: Instance, chosen: Sequence[int], number: Callable[[float], Number]) -> Number:
    """Sum of the costs of the chosen candidates, in the arithmetic of `number`."""
    total = number(0.0)
    for i in chosen:
        total = total + number(float(instance.cost[i]))
    return total


@dataclass(frozen=True, slots=True)
class Cover:
    """The problem itself: the cheapest plan that covers every element j with probability at least q_j (paper, Eq. 1)."""

    def evaluate(self, instance: Instance, chosen: Sequence[int], number: Callable[[float], Number]) -> Evidence:
        """Cost; q_j minus the coverage, where positive, for each element."""
        zero = number(0.0)
        missed = failures(instance, chosen, number)
        required = [number(float(q)) for q in instance.required]
        short = tuple(max(zero, q - (1 - miss)) for q, miss in zip(required, missed, strict=True))
        return Evidence(value=(total_cost(instance, chosen, number),), shortfall=short)

    def missing(self, instance: Instance, chosen: Sequence[int]) -> list[Sequence[int]]:
        """For each element that falls short, the candidates that cover it and are not chosen."""
        short = np.flatnonzero(instance.required - instance.coverage(chosen) > TOLERANCE)
        by_element = instance.probability.tocsr()
        taken = set(chosen)
        return [
            [int(i) for i in by_element.indices[by_element.indptr[j] : by_element.indptr[j + 1]] if i not in taken]
            for j in short
        ]
