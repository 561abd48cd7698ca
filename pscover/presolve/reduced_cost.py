"""Fixing columns by a bound: what cannot be part of a better plan.

**Proof.** Let r and a constant z satisfy c x >= z + r x for all plans x. For multipliers y >= 0 of the covering rows this
holds with r = c - W'y and z = sum y. Put every column into one of its cliques (disjoint groups, a plan holds at most one of
each). Then every plan costs at least L = z + sum over groups of min(0, min r). With x_i = 1 the group of i adds r_i instead
of min(0, min r); with x_i = 0 it adds min(0, the least r of the others). If that exceeds what a better plan may cost, x_i
is 0 (or 1) in all better plans. Fixings do not build on each other, so they hold together.

Source: Beasley 1990; Caprara, Fischetti, Toth 1999; with groups: Umetani, Arakawa, Yagiura 2018.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pscover.model import CoverForm

from ._groups import partitions
from ._sparse import FloatArray, IntArray, Rows
from .change import nothing

SAFE = 1e-9
"""Relative margin for the rounding of bounds."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fixed:
    """Columns that have the same value in all plans better than the upper bound.

    Parameters
    ----------
    zero, one
        Columns that are 0, and 1. Where they contradict each other, or the lower bound exceeds the upper, there is no
        better plan.
    lower
        The bound that was used.
    """

    zero: IntArray
    one: IntArray
    lower: float


def lagrangian(form: CoverForm, multipliers: FloatArray) -> tuple[FloatArray, float]:
    """Reduced costs c - W'y and the bound that multipliers y >= 0 of the covering rows prove, cliques included.

    Parameters
    ----------
    form
        Any form.
    multipliers
        y, shape (rows,); negative ones count as 0.

    Examples
    --------
    >>> from scipy.sparse import csr_array
    >>> W, P = csr_array(np.array([[1.0, 0.5, 1.0]])), csr_array(np.array([[1.0, 1.0, 0.0]]))
    >>> form = CoverForm(c=np.array([2.0, 2.0, 3.0]), W=W, P=P, allowed=np.ones(3, dtype=bool))
    >>> lagrangian(form, np.array([2.0]))
    (array([0., 1., 1.]), 2.0)
    """
    y = np.maximum(multipliers, 0.0)
    reduced = form.c - form.W.T @ y
    return reduced, float(y.sum() + _gain(form, reduced, next(partitions(Rows.of(form.P)))))


def fix_by_reduced_cost(form: CoverForm, reduced: FloatArray, lower: float, upper: float, *, step: float = 0.0) -> Fixed:
    """The columns whose value in every plan cheaper than `upper` is known.

    Parameters
    ----------
    form
        Any form.
    reduced
        r, shape (columns,).
    lower
        z + sum over groups of min(0, min r), where c x >= z + r x for all plans and the groups are the first of
        `partitions`: what `lagrangian` returns, or, where r >= 0, the value of a linear relaxation with its reduced costs.
        A smaller number is safe.
    upper
        The cost of a plan at hand.
    step
        Costs of plans differ by at least this: 1 for whole costs.
    """
    limit = upper - step + SAFE * max(1.0, abs(upper))
    groups = list(partitions(Rows.of(form.P)))
    constant = lower - _gain(form, reduced, groups[0])
    zero, one = np.flatnonzero(~form.allowed), nothing()
    for group in groups:
        bound = constant + _gain(form, reduced, group)
        best, least, second = _two_least(form, reduced, group)
        floor = np.zeros(int(group.max(initial=-1)) + 1)
        floor[group[best]] = np.minimum(least, 0.0)
        zero = np.union1d(zero, np.flatnonzero(bound - floor[group] + reduced > limit))
        one = np.union1d(one, best[bound - np.minimum(least, 0.0) + np.minimum(second, 0.0) > limit])
    return Fixed(zero=zero, one=one, lower=lower)


def _gain(form: CoverForm, reduced: FloatArray, group: IntArray) -> float:
    """The sum over groups of min(0, min r)."""
    _, least, _ = _two_least(form, reduced, group)
    return float(np.minimum(least, 0.0).sum())


def _two_least(form: CoverForm, reduced: FloatArray, group: IntArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """For each group of allowed columns: the first of least r, its r, and the next r (infinite if alone)."""
    allowed = np.flatnonzero(form.allowed)
    order = allowed[np.lexsort((reduced[allowed], group[allowed]))]
    of = group[order]
    starts = np.flatnonzero(np.diff(of, prepend=-1))
    following = np.append(reduced[order], np.inf)[starts + 1]
    alone = np.append(of, -1)[starts + 1] != of[starts]
    return order[starts], reduced[order[starts]], np.where(alone, np.inf, following)
