"""One solve as its observer sees it: the clock, the best plan and bound so far, and whether to stop."""

from __future__ import annotations

import math
from threading import RLock
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pscover.model import Model
from pscover.result import Answer, Observer, Progress, Settings, Status, Stop

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

THROTTLE = 0.02
"""Least seconds between two reports that bring nothing but a better bound."""


FEASIBILITY = 1e-9
"""By how much a row may be missed; relative in rows scaled to 1. The 1e-6 of most engines lets requirements be missed."""
CLAIMED = 1e-6
"""A point that misses a row by more than this is none, whatever an engine calls it."""


class Session:
    """Feeds an observer from an engine's callbacks.

    The methods that report never raise, because callbacks are called from compiled code: what the observer raises is kept,
    reads as the wish to stop, and is raised by `answer`. They may be called from several threads.

    Parameters
    ----------
    model, settings, observe
        As given to `Backend.solve`.
    """

    def __init__(self, model: Model, settings: Settings, observe: Observer) -> None:
        self.began = perf_counter()
        self.model = model
        self.settings = settings
        self.observe = observe
        self.integral = model.is_integral_cost
        self.chosen: IntArray | None = None
        self.objective = math.inf
        self.bound = -math.inf
        self.reserved = 0.0
        self.asked = False
        self.expired = False
        self.told = -math.inf
        self.failure: BaseException | None = None
        self.lock = RLock()

    @property
    def seconds(self) -> float:
        """Wall time since the solve began."""
        return perf_counter() - self.began

    @property
    def gap(self) -> float:
        """The relative gap for an engine that does not know the model's offset: never looser than the one asked for."""
        return self.settings.gap if self.model.offset >= 0 else 0.0

    @property
    def left(self) -> float:
        """Seconds left before what is reserved, not below 1 ms so that engines accept it; infinite without a limit."""
        return max(1e-3, self.settings.time - self.reserved - self.seconds)

    def over(self) -> bool:
        """Whether to stop: the observer asked to, or the time is up."""
        if self.seconds >= self.settings.time - self.reserved:
            self.expired = True
        return self.asked or self.expired

    def point(self, x: Any) -> bool:
        """Report a feasible point of the model, shape (variables,); True asks to stop."""
        try:
            x = np.asarray(x, dtype=np.float64)
            # Engines return integers with a tolerance; the objective is that of the point meant.
            meant = np.where(self.model.integer, np.round(x), x)
            objective = float(self.model.c @ meant) + self.model.offset
            return self.plan(chosen_of(self.model, x), objective)
        except BaseException as error:
            return self._fail(error)

    def start(self) -> bool:
        """Report the start, if there is one, it has no further variables and misses no row; True asks to stop."""
        x = start_of(self.model, self.settings)
        if x is not None and self.model.variables == self.model.candidates and violation(self.model, x) <= FEASIBILITY:
            return self.point(x)
        return self.over()

    def claimed(self, x: Any) -> bool:
        """Report a point that an engine returned at its end, unless it is plainly none; True asks to stop."""
        x = np.asarray(x, dtype=np.float64)
        good = x.shape == (self.model.variables,) and bool(np.isfinite(x).all())
        return self.point(x) if good and violation(self.model, x) <= CLAIMED else self.over()

    def plan(self, chosen: IntArray, objective: float) -> bool:
        """Report a plan with its objective, offset included; ignored unless better. True asks to stop."""
        with self.lock:
            if objective < self.objective:
                self.objective, self.chosen = objective, chosen
                self._tell(chosen)
            return self.over()

    def bounded(self, bound: float) -> bool:
        """Report a proven bound, offset included; ignored unless better. True asks to stop.

        It is rounded up where the objective is a whole number.
        """
        if self.integral and math.isfinite(bound):
            bound = max(bound, float(math.ceil(bound - 1e-6 * max(1.0, abs(bound)))))
        with self.lock:
            if math.isfinite(bound) and bound > self.bound:
                self.bound = bound
                if self.seconds - self.told >= THROTTLE:
                    self._tell(None)
            return self.over()

    def _tell(self, chosen: IntArray | None) -> None:
        self.told = self.seconds
        bound = min(self.bound, self.objective)
        progress = Progress(seconds=self.told, objective=self.objective, bound=bound, chosen=chosen)
        try:
            self.asked = bool(self.observe(progress)) or self.asked
        except BaseException as error:
            self._fail(error)

    def _fail(self, error: BaseException) -> bool:
        self.failure = self.failure or error
        self.asked = True
        return True

    def is_proven(self) -> bool:
        """Whether the plan meets the bound: to the gap asked for, or to rounding."""
        if self.chosen is None:
            return False
        return self.objective - self.bound <= max(self.settings.gap, 1e-9) * abs(self.objective)

    def answer(self, status: Status, message: str = "", *, timed_out: bool = False) -> Answer:
        """The engine's claim, with the best plan and bound reported; raises what the observer raised.

        `Status.UNKNOWN` becomes `Status.FEASIBLE` if there is a plan.
        """
        if self.failure is not None:
            raise self.failure
        stop = Stop.FINISHED
        if status not in (Status.OPTIMAL, Status.INFEASIBLE):
            self.over()
            status = Status.UNKNOWN if self.chosen is None else Status.FEASIBLE
            stop = Stop.OBSERVER if self.asked else Stop.TIME if self.expired or timed_out else Stop.FINISHED
        if status is Status.INFEASIBLE:
            return Answer(status=status, chosen=None, bound=math.inf, stop=stop, message=message)
        return Answer(status=status, chosen=self.chosen, bound=min(self.bound, self.objective), stop=stop, message=message)


def chosen_of(model: Model, x: FloatArray) -> IntArray:
    """The candidates whose variable is above 1/2."""
    return np.flatnonzero(x[: model.candidates] > 0.5).astype(np.int32)


def start_of(model: Model, settings: Settings) -> FloatArray | None:
    """The start as values of the candidates' variables, shape (candidates,), or None without one."""
    if settings.start is None:
        return None
    x = np.zeros(model.candidates)
    x[list(settings.start)] = 1.0
    return x


def violation(model: Model, x: FloatArray) -> float:
    """By how much a point misses a row or a bound at most."""
    activity = model.A @ x
    misses = (model.lo - activity, activity - model.hi, -x, x - model.ub)
    return max((float(miss.max()) for miss in misses if len(miss)), default=0.0)


def without_variables(session: Session) -> Answer | None:
    """The answer to a model that has no variables; None for any other."""
    model = session.model
    if model.variables:
        return None
    if (model.lo > 0).any() or (model.hi < 0).any():
        return session.answer(Status.INFEASIBLE)
    session.bounded(model.offset)
    session.point(np.zeros(0))
    return session.answer(Status.OPTIMAL)
