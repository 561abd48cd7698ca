"""Steps one after the other until nothing changes, and the way back from what is left."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from pscover.errors import UnknownName
from pscover.model import CoverForm

from ._fix import take
from ._sparse import IntArray, Mask, Rows, only_columns, only_rows, with_data
from ._view import View
from .change import Change, Over, Touch, never, nothing
from .clique_dominance import clique_dominance
from .cliques import cliques
from .cover_dominance import cover_dominance
from .demand import demand
from .entries import entries
from .forced import forced
from .identical import identical
from .probing import probing
from .reduced import Applied, Outcome, Reduced
from .row_dominance import row_dominance
from .scaling import scaling
from .useless import useless


@dataclass(frozen=True, slots=True)
class Step:
    """A reduction, and after which changes it may find something new."""

    apply: Callable[[View, Over], Change]
    after: Touch
    late: bool = False
    """Whether to wait until the other steps find nothing more, unless the form is large."""


SHAPE = Touch.ROWS | Touch.ENTRIES | Touch.PACKING
SUPPLY = Touch.COLUMNS | Touch.ENTRIES | Touch.PACKING
STEPS: dict[str, Step] = {
    "useless": Step(useless, SHAPE | SUPPLY),
    "scaling": Step(scaling, Touch.COLUMNS | Touch.ENTRIES),
    "cliques": Step(cliques, Touch.PACKING),
    "clique-dominance": Step(clique_dominance, SHAPE),
    "forced": Step(forced, SUPPLY),
    "probing": Step(probing, SUPPLY),
    "entries": Step(entries, SUPPLY),
    "row-dominance": Step(row_dominance, Touch.COLUMNS | Touch.ENTRIES),
    "identical": Step(identical, SHAPE | Touch.LOOSENED),
    "cover-dominance": Step(cover_dominance, SHAPE | Touch.LOOSENED),
    "demand": Step(demand, SUPPLY, late=True),
}
"""The steps by name."""
DEFAULT = tuple(STEPS)
"""All steps, in an order in which cheap ones come early."""

LARGE = 50_000
"""A form with more non-zeros is given up when a round of all steps removes less than `WORTH` of them."""
WORTH = 0.05


def presolve(form: CoverForm, *, steps: Sequence[str] = DEFAULT, over: Over = never) -> Reduced:
    """Make a form smaller without losing its optimal value.

    Every step keeps at least one optimal plan, if there is a plan at all; its proof stands in its module. Plans of what is
    left, lifted, are plans of the original at the cost plus `fixed_cost`.

    Parameters
    ----------
    form
        Covering and packing rows over binaries.
    steps
        Names of the steps to apply, in this order, again and again until none changes anything.
    over
        Asked between and within steps whether to stop; what was found by then is returned.

    Returns
    -------
    Reduced

    Raises
    ------
    UnknownName
        For a name that is no step.

    Examples
    --------
    >>> from scipy.sparse import csr_array
    >>> W = csr_array(np.array([[0.6, 0.5, 0.0], [0.0, 0.5, 1.0]]))
    >>> P = csr_array(np.array([[1.0, 0.0, 1.0]]))
    >>> form = CoverForm(c=np.ones(3), W=W, P=P, allowed=np.ones(3, dtype=bool))
    >>> reduced = presolve(form)
    >>> reduced.status.value, reduced.infeasible_row
    ('infeasible', 1)
    >>> reduced = presolve(CoverForm(c=form.c, W=W, P=csr_array((0, 3)), allowed=form.allowed))
    >>> reduced.status.value, reduced.lift([]).tolist(), reduced.fixed_cost
    ('solved', [0, 1, 2], 3.0)
    """
    for name in steps:
        if name not in STEPS:
            raise UnknownName.among("presolve step", name, STEPS)
    work = _Work(form)
    due = dict.fromkeys(steps, True)
    while not work.is_done and any(due.values()) and not over():
        size = work.view.W.nnz
        for name in steps:
            if work.is_done or over():
                break
            waits = STEPS[name].late and any(due[other] for other in due if other != name)
            if due[name] and (work.view.W.nnz > LARGE or not waits):
                due[name] = False
                touched = work.run(name, over)
                due = {other: due[other] or bool(touched & STEPS[other].after) for other in due}
        if work.view.W.nnz > max(LARGE, (1 - WORTH) * size):
            break
    return work.result()


class _Work:
    """A form that shrinks, and where its rows and columns came from."""

    def __init__(self, form: CoverForm) -> None:
        W = Rows.of(form.W)
        W = with_data(W, np.minimum(W.data, 1.0))
        allowed = np.asarray(form.allowed, dtype=np.bool_)
        self.view = View(np.asarray(form.c, dtype=np.float64), W, Rows.of(form.P))
        self.columns = np.arange(len(form.c))
        self.rows = np.arange(W.shape[0])
        self.stand_in = np.where(allowed, self.columns, -1)
        self.forced: list[IntArray] = []
        self.fixed_cost = 0.0
        self.infeasible_row: int | None = None
        self.log: list[Applied] = []
        if not allowed.all():
            self._keep(np.ones(len(self.rows), dtype=np.bool_), allowed)

    @property
    def is_done(self) -> bool:
        """Whether there is nothing left to reduce."""
        return self.infeasible_row is not None or not len(self.rows)

    def run(self, name: str, over: Over) -> Touch:
        """Apply one step; what it changed."""
        began = perf_counter()
        rows, columns = len(self.rows), len(self.columns)
        change = STEPS[name].apply(self.view, over)
        touched = Touch(0)
        if not change.is_none:
            self._apply(change)
            touched = change.touched
            touched |= Touch.ROWS if len(self.rows) < rows else Touch(0)
            touched |= Touch.COLUMNS if len(self.columns) < columns else Touch(0)
        seconds = perf_counter() - began
        self.log.append(Applied(name, rows - len(self.rows), columns - len(self.columns), seconds))
        return touched

    def _apply(self, change: Change) -> None:
        if change.infeasible_row is not None:
            self.infeasible_row = int(self.rows[change.infeasible_row])
            return
        view = self.view
        columns = np.ones(len(view.c), dtype=np.bool_) if change.columns is None else change.columns
        rows = np.ones(len(self.rows), dtype=np.bool_) if change.rows is None else change.rows
        if change.W is not None or change.P is not None:
            self.view = View(view.c, view.W if change.W is None else change.W, view.P if change.P is None else change.P)
        if change.stand_in is not None:
            self._replace(columns, change.stand_in)
        if len(change.take):
            rows, columns = self._take(change, rows, columns)
        if self.infeasible_row is None:
            self._keep(rows, columns)

    def _replace(self, columns: Mask, stand_in: IntArray) -> None:
        """Note what takes the place of columns that go; what replaces may go as well, so chains are followed."""
        end = np.where(columns, np.arange(len(columns)), stand_in)
        while not (columns[end] | (end < 0) | (stand_in[end] == end)).all():
            end = np.where(columns[end], end, stand_in[end])
        gone = ~columns & columns[end]
        target = np.full(len(self.stand_in), -1, dtype=np.int64)
        target[self.columns] = self.columns
        target[self.columns[gone]] = self.columns[end[gone]]
        known = self.stand_in >= 0
        self.stand_in[known] = target[self.stand_in[known]]

    def _take(self, change: Change, rows: Mask, columns: Mask) -> tuple[Mask, Mask]:
        left = take(self.view, change.take)
        if left.broken >= 0:
            reason = change.because[change.take == left.broken]
            self.infeasible_row = int(self.rows[reason[0]])
            return rows, columns
        self.forced.append(self.columns[change.take])
        self.fixed_cost += float(self.view.c[change.take].sum())
        self.view = View(self.view.c, left.W, left.P)
        return rows & ~left.met, columns & left.free

    def _keep(self, rows: Mask, columns: Mask) -> None:
        if rows.all() and columns.all():
            return
        c, W, P = self.view.c, self.view.W, self.view.P
        if not rows.all():
            W = only_rows(W, rows)
            self.rows = self.rows[rows]
        if not columns.all():
            c, W, P = c[columns], only_columns(W, columns), only_columns(P, columns)
            self.columns = self.columns[columns]
        self.view = View(c, W, P)

    def result(self) -> Reduced:
        """What is left."""
        view = self.view
        status = Outcome.SOLVED if not len(self.rows) else Outcome.REDUCED
        chosen = np.sort(np.concatenate([nothing(), *self.forced]))
        alive = np.zeros(len(self.stand_in) + 1, dtype=np.bool_)
        alive[self.columns] = True
        alive[chosen] = True
        return Reduced(
            form=CoverForm(c=view.c, W=view.W.csr(), P=view.P.csr(), allowed=np.ones(len(view.c), dtype=np.bool_)),
            fixed_cost=self.fixed_cost,
            status=Outcome.INFEASIBLE if self.infeasible_row is not None else status,
            columns=self.columns,
            rows=self.rows,
            forced=chosen,
            stand_in=np.where(alive[self.stand_in], self.stand_in, -1),
            infeasible_row=self.infeasible_row,
            log=tuple(self.log),
        )
