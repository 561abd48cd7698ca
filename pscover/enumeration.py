"""The oracle: all conflict-free plans of a small instance, each weighed by a goal, and no model anywhere."""

from __future__ import annotations

import numpy as np

from pscover.errors import Refused
from pscover.goal import Cover, Evidence, Goal
from pscover.instance import TOLERANCE, Instance

LIMIT = 20
"""Most candidates of an instance whose plans are listed."""

Plan = tuple[int, ...]
Value = tuple[float, ...]


def conflict_free(instance: Instance) -> list[Plan]:
    """All plans with at most one candidate of every clique, the empty one first.

    Raises
    ------
    Refused
        If the instance has more than `LIMIT` candidates.

    Examples
    --------
    >>> conflict_free(Instance.of([[0.5, 0.5, 0.5]], conflicts=[(0, 1), (0, 2)]))
    [(), (0,), (1,), (2,), (1, 2)]
    """
    n = instance.candidates
    if n > LIMIT:
        raise Refused(f"listing all plans takes at most {LIMIT} candidates, got {n}")
    excluded = [0] * n
    for clique in instance.conflicts:
        together = sum(1 << int(i) for i in clique)
        for i in clique.tolist():
            excluded[i] |= together
    plans: list[tuple[Plan, int]] = [((), 0)]
    for i in range(n):
        plans += [((*plan, i), barred | excluded[i]) for plan, barred in plans if not barred >> i & 1]
    return [plan for plan, _ in plans]


def enumerate_best(instance: Instance, goal: Goal, *, slack: float = TOLERANCE) -> tuple[Value | None, Plan]:
    """The best feasible plan by listing all of them: an oracle that shares no code with any model.

    Parameters
    ----------
    instance
        Of at most `LIMIT` candidates.
    goal
        What makes a plan good.
    slack
        Values closer than this count as equal, so that the next objective decides.

    Returns
    -------
    value
        The best value, or None if no plan is feasible.
    chosen
        A plan with that value.

    Examples
    --------
    >>> enumerate_best(Instance.of([[0.8, 0.6, 0.6]], required=0.8, cost=[3, 1, 1]), Cover())
    ((2.0,), (1, 2))
    """
    plans = conflict_free(instance)
    if isinstance(goal, Cover):
        plans = _covering(instance, plans, slack)
    weighed = [(plan, goal.evaluate(instance, plan, float)) for plan in plans]
    best = [(plan, values(evidence)) for plan, evidence in weighed if evidence.is_feasible]
    if not best:
        return None, ()
    for k in range(len(best[0][1])):
        least = min(value[k] for _, value in best)
        best = [(plan, value) for plan, value in best if value[k] <= least + slack]
    return best[0][1], best[0][0]


def _covering(instance: Instance, plans: list[Plan], slack: float) -> list[Plan]:
    """The cheapest of the plans that cover, all weighed at once: listing is only as good as it is quick."""
    taken = np.zeros((len(plans), instance.candidates), dtype=bool)
    for row, plan in enumerate(plans):
        taken[row, list(plan)] = True
    miss = 1.0 - instance.probability.toarray()
    missed = np.ones((len(plans), instance.elements))
    for i in range(instance.candidates):
        missed[taken[:, i]] *= miss[:, i]
    feasible = (instance.required - (1.0 - missed) <= 2 * TOLERANCE).all(axis=1)
    cost = taken @ instance.cost
    cheapest = np.min(cost[feasible], initial=np.inf)
    # A margin on both sides: the goal itself decides.
    return [plans[row] for row in np.flatnonzero(feasible & (cost <= cheapest * (1 + 1e-6) + slack))]


def values(evidence: Evidence) -> Value:
    """The objectives of a plan as floats."""
    return tuple(float(value) for value in evidence.value)
