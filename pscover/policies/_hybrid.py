"""What the hybrid policies share: depth while there is a pile, segments when there is none (paper, section 6)."""

from __future__ import annotations

import numpy as np

from pscover.errors import InvalidSettings
from pscover.execution.sight import Sight
from pscover.policies._cycle import Cycle, Pending, next_grasp
from pscover.policy import Decision, Policy


def check_pile(pile_metres: float) -> None:
    """Raise `InvalidSettings` unless a height is a number of at least 0."""
    if not pile_metres >= 0:
        raise InvalidSettings(f"pile_metres: expected a number of at least 0, got {pile_metres!r}")


def depth_or_segments(
    by_depth: Policy, cycle: Cycle, pile_metres: float, sight: Sight, state: object | None, random: np.random.Generator
) -> Decision:
    """One grasp by depth if the tallest pile exceeds a height, else one cycle by segments, which is not interrupted."""
    in_cycle = isinstance(state, Pending) and bool(state.targets)
    if in_cycle:
        left, skipped = cycle.left(sight, state)
        if left is not None:
            return next_grasp(cycle, sight, state, random)
    else:
        skipped = ()
    if float(np.where(sight.cloth, sight.heights, 0.0).max()) > pile_metres:
        grasp = by_depth.next(sight, None, random)
        return Decision(actions=grasp.actions, skipped=skipped)
    return next_grasp(cycle, sight, state, random)
