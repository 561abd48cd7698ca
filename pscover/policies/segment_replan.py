"""Segment again and plan again after every transport, from what remains of the plan."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from pscover.errors import InvalidSettings
from pscover.execution.sight import Sight
from pscover.policies._cycle import Cycle, Pending, pending
from pscover.policies._kept import plan_from
from pscover.policy import Decision, trip

BUDGETED = Cycle(seconds=2.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentReplan:
    """The segment method with a segmentation and a plan for every grasp, within a time budget.

    The paper's policy `segment` segments once a cycle, for its segmentation took 19 s. What is left of the last plan
    and still looks the same is among the candidates of the next, whose search starts from it.

    Parameters
    ----------
    cycle
        How to plan; here `seconds` is the budget of each grasp. Its candidates are sampled: what is left joins the draw.

    Raises
    ------
    InvalidSettings
        If other candidates are asked for.

    Examples
    --------
    >>> from pscover.execution.tabletop import small_table
    >>> table, random = small_table(), np.random.default_rng(0)
    >>> first = SegmentReplan().next(table.sight(), None, random)
    >>> second = SegmentReplan().next(table.sight(), first.state, random)
    >>> len(first.plan.grasps), second.plan is None
    (3, False)
    """

    name: ClassVar[str] = "segment-replan"
    needs_depth: ClassVar[bool] = False

    cycle: Cycle = BUDGETED

    def __post_init__(self) -> None:
        if self.cycle.candidates != "sampled":
            raise InvalidSettings(f"candidates: expected 'sampled' for {self.name!r}, got {self.cycle.candidates!r}")

    def next(self, sight: Sight, state: object | None, random: np.random.Generator) -> Decision:
        """The first grasp of the new plan."""
        left, skipped = self.cycle.left(sight, state)
        old = () if left is None else tuple(target.pose for target in left.targets)
        made = plan_from(self.cycle, sight, old, int(random.integers(2**31)))
        new: Pending = pending(self.cycle, sight, made.instance, made.grasps)
        if not new.targets:
            return Decision(actions=(), skipped=skipped, plan=made)
        target, rest = new.targets[0], new.targets[1:]
        return Decision(
            actions=trip(target.pose, basket=target.basket),
            state=replace(new, targets=rest),
            skipped=skipped,
            plan=made,
        )


policy = SegmentReplan
