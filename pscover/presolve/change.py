"""What a reduction says: which rows and columns stay, which columns are taken, and what the rest looks like.

A plan is *feasible* when every covering row has a supply of at least 1 - 1e-9, every packing row a use of at most
1 + 1e-9 and every chosen column is allowed. All steps keep exactly this notion of feasible: a row that loses a taken
column is rescaled so that the tolerance stays that of the original row, and what is compared to 1 - 1e-9 after sums of
many floats gets a margin of 1e-12 on the side that keeps plans.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Flag, auto
from typing import TypeAlias

import numpy as np

from ._sparse import IntArray, Mask, Rows

Over: TypeAlias = Callable[[], bool]

TOLERANCE = 1e-9
"""A row scaled to 1 counts as met when it is missed by no more than this."""
SHORT = 1 - TOLERANCE - 1e-12
"""A supply below this leaves a covering row short, whatever rounding did to the sum."""


def nothing() -> IntArray:
    """No index."""
    return np.zeros(0, dtype=np.int64)


def never() -> bool:
    """A clock that never runs out."""
    return False


class Touch(Flag):
    """What a change changes."""

    COLUMNS = auto()
    """Columns are gone."""
    ROWS = auto()
    """Covering rows are gone."""
    ENTRIES = auto()
    """Covering rows have other entries."""
    PACKING = auto()
    """Packing rows are others."""
    LOOSENED = auto()
    """Packing rows without effect are gone."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Change:
    """The outcome of one step; indices are those of the form it was given. The default is no change.

    Parameters
    ----------
    columns
        Which columns stay, shape (columns,); the others are 0 in some optimal plan.
    stand_in
        For each column that goes the column that can take its place in a plan, or -1, shape (columns,).
    take
        Columns that are 1 in some optimal plan.
    because
        For each of `take` the covering row that asks for it, or -1.
    rows
        Which covering rows stay, shape (rows,); the others are implied.
    W
        The covering rows with other entries, same shape.
    P
        Other packing rows over the same columns.
    infeasible_row
        A covering row that no plan meets.
    loosened
        Whether P is what it was without rows that have no effect.
    """

    columns: Mask | None = None
    stand_in: IntArray | None = None
    take: IntArray = field(default_factory=nothing)
    because: IntArray = field(default_factory=nothing)
    rows: Mask | None = None
    W: Rows | None = None
    P: Rows | None = None
    infeasible_row: int | None = None
    loosened: bool = False

    @property
    def is_none(self) -> bool:
        """Whether everything stays as it is."""
        masks = all(mask is None or bool(mask.all()) for mask in (self.columns, self.rows))
        return masks and not len(self.take) and self.W is None and self.P is None and self.infeasible_row is None

    @property
    def touched(self) -> Touch:
        """What changes beside the rows and columns that go."""
        touched = Touch(0)
        if self.W is not None or len(self.take):
            touched |= Touch.ENTRIES
        if self.P is not None and not self.loosened:
            touched |= Touch.PACKING
        if self.P is not None or len(self.take):
            touched |= Touch.LOOSENED
        return touched
