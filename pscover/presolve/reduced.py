"""The result of presolve and the way back."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pscover.model import CoverForm

from ._sparse import IntArray


class Outcome(StrEnum):
    """How far presolve came."""

    REDUCED = "reduced"
    """Covering rows are left to be met."""
    SOLVED = "solved"
    """None is left: the forced columns are an optimal plan."""
    INFEASIBLE = "infeasible"
    """Proven: there is no plan."""


class Applied(NamedTuple):
    """One application of a step."""

    step: str
    rows: int
    columns: int
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reduced:
    """A smaller form with the same optimal value, and how its plans become plans of the original.

    Parameters
    ----------
    form
        What is left; all its columns are allowed.
    fixed_cost
        Cost of the forced columns.
    status
        See `Outcome`.
    columns
        The original column of each column of `form`.
    rows
        The original covering row of each covering row of `form`.
    forced
        Original columns that are fixed to 1.
    stand_in
        For each original column the one that takes its place in plans: itself while it is in `form` or forced, -1 where
        there is none.
    infeasible_row
        If infeasible: an original covering row that cannot be met together with what was derived before.
    log
        The steps that ran, in order: rows and columns removed, seconds.
    """

    form: CoverForm
    fixed_cost: float
    status: Outcome
    columns: IntArray
    rows: IntArray
    forced: IntArray
    stand_in: IntArray
    infeasible_row: int | None
    log: tuple[Applied, ...]

    def lift(self, chosen: ArrayLike | NDArray[np.integer[Any]]) -> IntArray:
        """The original plan of a plan of `form`, both as column indices, sorted."""
        plan = np.asarray(chosen, dtype=np.int64)
        return np.sort(np.concatenate((self.columns[plan], self.forced)))

    def project(self, chosen: ArrayLike | NDArray[np.integer[Any]]) -> IntArray:
        """A start for `form` from an original plan: columns that were removed are replaced where something can.

        The result may miss rows even if the plan was feasible, since not every reduction knows a replacement.
        """
        inside = np.full(len(self.stand_in), -1, dtype=np.int64)
        inside[self.columns] = np.arange(len(self.columns))
        stand_in = self.stand_in[np.asarray(chosen, dtype=np.int64)]
        found = inside[stand_in[stand_in >= 0]]
        return np.unique(found[found >= 0])

    def lower_bound(self, bound: float) -> float:
        """The bound on the original that a bound on `form` proves."""
        return self.fixed_cost + bound
