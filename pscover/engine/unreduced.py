"""Forms as presolve hands them on, with little or nothing taken from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pscover.model import CoverForm
from pscover.presolve import Outcome, Reduced

from .problem import problem_of
from .replaced import stand_ins


def unreduced(form: CoverForm) -> Reduced:
    """A form from which nothing was taken."""
    every = np.arange(len(form.c))
    return Reduced(
        form=form,
        fixed_cost=0.0,
        status=Outcome.REDUCED,
        columns=every,
        rows=np.arange(form.W.shape[0]),
        forced=np.zeros(0, dtype=np.int64),
        stand_in=every,
        infeasible_row=None,
        log=(),
    )


def without_replaced(form: CoverForm) -> Reduced:
    """The form without candidates that another of their clique replaces."""
    problem, columns = problem_of(form)
    found = columns[stand_ins(problem)].astype(np.int64)
    left = np.unique(found)
    stand_in = np.full(len(form.c), -1)
    stand_in[columns] = found
    return replace(unreduced(form), form=form.among(left), columns=left, stand_in=stand_in)
