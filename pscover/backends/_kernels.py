"""What the engines built on our kernels share: a plan while the kernels get ready, and the least step in cost."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from pscover.engine.problem import least_step as least_step
from pscover.model import CoverForm

from ._cover import Search, repair
from ._session import Session

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]
SHORTEST, LONGEST, PART = 0.02, 0.5, 0.1
"""Seconds to improve a certificate, at least and at most, and the part of what the proof took."""
NOTING, MOST_RESERVED = 1.5e-6, 0.1
"""Seconds an entry that it takes to write down a certificate, and the most of what is left that is kept for it."""
PAUSE = 2e-3
"""Seconds between two looks at whether the kernels are ready."""
MOST_LOADING = 5.0
"""Seconds that loading kernels takes at most, on a slow machine."""
MOVES = 2000
"""Most repair moves in numpy."""


def feasible_start(form: CoverForm, start: Iterable[int]) -> IntArray | None:
    """The start if it covers, pruned; None otherwise."""
    search = Search(form)
    search.take(sorted(start))
    if not search.is_feasible():
        return None
    search.reverse_delete()
    return search.chosen


def plain_plan(form: CoverForm, session: Session) -> IntArray | None:
    """A greedy plan by numpy alone."""
    search = Search(form)
    rng = np.random.default_rng(session.settings.seed)
    if search.complete(session.over) or repair(search, rng, MOVES, session.over):
        search.reverse_delete()
        return search.chosen
    return None


def are_loaded_within(seconds: float, session: Session) -> bool:
    """Wait at most so long for the kernels; whether they are ready."""
    from pscover.engine.warm import warming

    warm, end = warming(), session.seconds + min(seconds, MOST_LOADING)
    while not warm.wait(PAUSE):
        if session.over() or session.seconds > end:
            return False
    return warm.error is None


def certifying(session: Session) -> float:
    """Seconds to look for more than the proof knows to certify its bound: a small part of what the proof took."""
    return min(LONGEST, max(SHORTEST, PART * session.seconds), session.left / 2)


def reserve(session: Session, form: CoverForm) -> None:
    """Keep the time that it takes to write down what a form's rows pay, if that is done, but not much of what is left."""
    from pscover.engine.certify import MOST

    if form.W.nnz <= MOST:
        session.reserved = min(NOTING * form.W.nnz, MOST_RESERVED * session.left)


def await_kernels(session: Session) -> bool:
    """Wait until the kernels are ready; False if the session is over first."""
    from pscover.engine.warm import warming

    warm = warming()
    while not warm.wait(PAUSE):
        if session.over():
            return False
    if warm.error is not None:
        raise warm.error
    return not session.over()
