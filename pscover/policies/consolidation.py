"""Consolidation: gather several grasps on the way to the basket before going there (paper, section 6)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from pscover.errors import InvalidSettings
from pscover.execution.sight import Sight
from pscover.policies._cycle import CYCLE, Cycle, Target
from pscover.policy import Decision, trip


@dataclass(frozen=True, slots=True, kw_only=True)
class Consolidation:
    """A plan's grasps by decreasing distance to the basket, chained: what one picks is put down where the next one picks.

    A chain goes on while the sum of expected areas, sum over garments of p_ij |M_j|, stays within a threshold; a grasp that
    does not fit is passed over for the next one in the plan. When none fits, what is gathered goes to the basket, and
    the next chain begins with the rest.

    Parameters
    ----------
    most_cm2
        The threshold, in square centimetres of cloth seen by the camera. The paper names no number; this is about a
        garment and a half of its kind.
    cycle
        How to plan, and when to skip.

    Raises
    ------
    InvalidSettings
        If the threshold is not positive.

    Examples
    --------
    >>> from pscover.execution.tabletop import small_table
    >>> sight, random = small_table().sight(), np.random.default_rng(0)
    >>> [type(action).__name__ for action in Consolidation().next(sight, None, random).actions]
    ['Pick', 'Place', 'Pick', 'Place', 'Pick', 'Transport']
    >>> [type(action).__name__ for action in Consolidation(most_cm2=1.0).next(sight, None, random).actions]
    ['Pick', 'Transport']
    """

    name: ClassVar[str] = "consolidation"
    needs_depth: ClassVar[bool] = False

    most_cm2: float = 300.0
    cycle: Cycle = CYCLE

    def __post_init__(self) -> None:
        if not self.most_cm2 > 0:
            raise InvalidSettings(f"most_cm2: expected a positive number, got {self.most_cm2!r}")

    def next(self, sight: Sight, state: object | None, random: np.random.Generator) -> Decision:
        """The next chain of grasps."""
        left, skipped = self.cycle.left(sight, state)
        made = None
        if left is None:
            left, made = self.cycle.fresh(sight, random)
            left = replace(left, targets=tuple(sorted(left.targets, key=lambda target: -target.distance)))
        gathered, rest = chain(left.targets, self.most_cm2)
        return Decision(
            actions=trip(*(target.pose for target in gathered), basket=gathered[0].basket if gathered else ""),
            state=replace(left, targets=rest),
            skipped=skipped,
            plan=made,
        )


def chain(targets: tuple[Target, ...], most_cm2: float) -> tuple[tuple[Target, ...], tuple[Target, ...]]:
    """The targets that go to the basket together, and those that are left; the first always goes.

    Examples
    --------
    >>> from pscover.robot import Pose
    >>> targets = [Target(pose=Pose(x=k, y=0), distance=9.0 - k, area_cm2=area) for k, area in enumerate((6, 5, 3, 1, 2))]
    >>> [[target.area_cm2 for target in part] for part in chain(tuple(targets), 10)]
    [[6, 3, 1], [5, 2]]
    """
    gathered: list[Target] = []
    rest: list[Target] = []
    total = 0.0
    for target in targets:
        fits = not gathered or (total + target.area_cm2 <= most_cm2 and target.basket == gathered[0].basket)
        (gathered if fits else rest).append(target)
        total += target.area_cm2 if fits else 0.0
    return tuple(gathered), tuple(rest)


policy = Consolidation
