"""A plan over all poses: choose from those that cheap plans may hold, then from more, until no other one can help."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csc_array

from pscover.errors import Refused
from pscover.formulation import Formulation
from pscover.goal import Cover
from pscover.grasping.all_poses import AllPoses, IntArray, all_poses
from pscover.grasping.conflict_partition import SamePart
from pscover.grasping.conflicts import Conflicts, rule
from pscover.grasping.diving import dive
from pscover.grasping.pool import Scope, instance_of, select
from pscover.grasping.predictor import Predictor
from pscover.grasping.pricing import Prices, price, tightened
from pscover.grasping.sampling import Sampling
from pscover.instance import Instance
from pscover.result import VALUE_TOLERANCE, Result, Status, Stop
from pscover.scene import Scene

FloatArray = NDArray[np.float64]
FIRST, WIDEST = 2_000, 32_000
"""About how many poses the first search chooses from, and the last."""
FACTOR = 4
"""How many times more each search chooses from than the one before."""
STAGE = 20.0
"""Most seconds of a search that may be followed by a wider one."""
WORTH, BOTH = 0.2, 0.6
"""Seconds that must be left for a wider search to be of use, and for one and another."""
DIVING = 0.6
"""The part of the time that a first plan may take."""
CUTTING = 0.6
"""The part of what is left of it that cuts may take."""
DRAWING = 0.5
"""The part of the time that weighing all poses may take; then candidates are drawn instead."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grid:
    """Every pose of a scene, weighed and priced.

    Parameters
    ----------
    scene, predictor, required
        What to clear, what a grasp will probably remove, and how surely each garment is to be removed.
    poses, prices
        See `pscover.grasping.all_poses` and `pscover.grasping.pricing`.
    """

    scene: Scene
    predictor: Predictor
    required: FloatArray
    poses: AllPoses
    prices: Prices

    def instance(self, numbers: IntArray) -> Instance:
        """The problem of choosing from some of the poses."""
        return instance_of(self.scene, self.poses, numbers, self.predictor, self.required)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Searched:
    """The last search, and what is proven over its scope.

    Parameters
    ----------
    instance, result
        Of the last search.
    bound
        No plan from the scope that meets every requirement has fewer grasps.
    scope
        Of the last search.
    """

    instance: Instance
    result: Result
    bound: float
    scope: Scope


Stage = Callable[[Instance, tuple[int, ...] | None, float, float, float], Result]
"""Solves an instance from a start (None: make one) within some seconds, given what is proven already and above which bound
it proves nothing; a plan that meets what is proven ends it."""


def grid_of(
    scene: Scene,
    sampling: Sampling,
    predictor: Predictor,
    conflicts: str | Conflicts | Sequence[str | Conflicts],
    required: ArrayLike,
    formulation: Formulation,
    *,
    over: Callable[[], bool],
) -> Grid | None:
    """Weigh and price every pose; None if that is over first.

    Raises
    ------
    Refused
        For conflicts other than those of the partition, and goals other than the fewest grasps: poses are left out by
        arguments that hold for these alone.
    InvalidInstance, UnknownName
        As `pscover.grasping.candidates.candidates` does.
    """
    several = [conflicts] if isinstance(conflicts, str) or not isinstance(conflicts, Sequence) else conflicts
    if not several or not all(isinstance(rule(one) if isinstance(one, str) else one, SamePart) for one in several):
        raise Refused(
            f"candidates 'all': expected the conflict rule 'partition' alone, got {conflicts!r}: which poses can be left "
            "out is known only where all poses of a part exclude each other; use candidates 'sampled'"
        )
    if not isinstance(formulation.goal, Cover):
        raise Refused(
            f"candidates 'all': expected a formulation of the fewest grasps, got {formulation.name!r}; use "
            "candidates 'sampled'"
        )
    wanted = Instance.of(csc_array((scene.garments, 0)), required).required
    poses = all_poses(scene, sampling, predictor, wanted, over)
    if poses is None:
        return None
    prices = price(poses, over)
    if prices is None:
        return None
    return Grid(scene=scene, predictor=predictor, required=wanted, poses=poses, prices=prices)


def search(instance: Instance, solve_stage: Stage, left: Callable[[], float]) -> Searched:
    """Search once, among candidates that were drawn."""
    result = solve_stage(instance, None, left(), -math.inf, math.inf)
    return Searched(
        instance=instance,
        result=result,
        bound=result.bound,
        scope=Scope(candidates="sampled", poses=instance.candidates),
    )


def widen(grid: Grid, solve_stage: Stage, left: Callable[[], float]) -> Searched:
    """Search among the most promising poses, then among more, while poses left out might still make a better plan.

    Parameters
    ----------
    grid
        Every pose.
    solve_stage
        Solves one instance.
    left
        Seconds left.
    """
    begun = None if grid.prices.out_of_reach else dive(grid.poses, grid.prices, _past(clock.monotonic() + DIVING * left()))
    start = np.zeros(0, dtype=np.int64) if begun is None else begun
    bound, best = whole(grid.prices.bound), math.inf if begun is None else float(len(begun))
    prices = tightened(grid.prices, best - 1, _past(clock.monotonic() + CUTTING * left()))
    bound = max(bound, whole(prices.bound))
    size, most = -1, FIRST
    while True:
        began = clock.monotonic()
        selection = select(grid.poses, prices, most, best - 1, _past(began + left() / 4))
        numbers, floor = np.union1d(selection.numbers, start), whole(selection.floor)
        instance = grid.instance(numbers)
        is_late = left() < max(BOTH, 4 * FACTOR * (clock.monotonic() - began))
        is_last = is_late or floor >= best or math.isinf(floor) or most >= WIDEST or len(numbers) <= size
        known = tuple(np.searchsorted(numbers, start).tolist()) if len(start) else None
        result = solve_stage(instance, known, left() if is_last else min(STAGE, left() / 2), bound, floor)
        if result.has_plan and result.objective <= bound:
            result = replace(result, stop=Stop.FINISHED)
        bound = max(bound, min(whole(result.bound), floor))
        best = result.objective if result.has_plan else math.inf
        stopped = result.stop in (Stop.OBSERVER, Stop.INTERRUPT)
        if is_last or floor >= best or bound >= best - VALUE_TOLERANCE or stopped or left() < WORTH:
            scope = Scope(candidates="all", poses=len(grid.poses), floor=floor)
            return Searched(instance=instance, result=result, bound=bound, scope=scope)
        if result.has_plan and result.chosen is not None:
            start = numbers[result.chosen]
        size, most = len(numbers), most * FACTOR


def _past(end: float) -> Callable[[], bool]:
    return lambda: clock.monotonic() > end


def whole(bound: float) -> float:
    """What a bound says of a number of grasps."""
    return float(math.ceil(bound - VALUE_TOLERANCE * max(1.0, abs(bound)))) if math.isfinite(bound) else bound


def status_of(result: Result, bound: float, scope: Scope) -> Status:
    """What is known of the problem over the scope, after a search that had every requirement to meet.

    Examples
    --------
    A plan that is optimal among the poses it was chosen from may not be so among all:

    >>> from pscover.solve import solve
    >>> result = solve(Instance.of([[0.8]]), backend="greedy")
    >>> str(status_of(result, 1.0, Scope(candidates="all", poses=9, floor=1.0)))
    'optimal'
    >>> str(status_of(result, 0.0, Scope(candidates="all", poses=9, floor=0.0)))
    'feasible'
    """
    if scope.candidates == "sampled":
        return result.status
    if not result.has_plan:
        return Status.INFEASIBLE if math.isinf(bound) and bound > 0 else Status.UNKNOWN
    slack = max(VALUE_TOLERANCE, result.settings.gap) * max(1.0, abs(result.objective))
    return Status.OPTIMAL if result.objective - bound <= slack else Status.FEASIBLE
