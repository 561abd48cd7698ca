"""The segment method: plan by probabilistic set cover, execute, look, skip, plan again (paper, section 5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pscover.execution.sight import Sight
from pscover.policies._cycle import CYCLE, Cycle, next_grasp
from pscover.policy import Decision


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """One plan a cycle, its grasps by increasing distance to the basket.

    After each transport the squared pixel difference to the cycle's first image is taken around every grasp that is
    left; where it is large, the grasp is skipped. There is no new segmentation until the plan is used up.

    Parameters
    ----------
    cycle
        How to plan, and when to skip.

    Examples
    --------
    >>> from pscover.execution.tabletop import small_table
    >>> decision = Segment().next(small_table().sight(), None, np.random.default_rng(0))
    >>> len(decision.plan.grasps), len(decision.state.targets)
    (3, 2)
    """

    name: ClassVar[str] = "segment"
    needs_depth: ClassVar[bool] = False

    cycle: Cycle = CYCLE

    def next(self, sight: Sight, state: object | None, random: np.random.Generator) -> Decision:
        """The next grasp of the plan."""
        return next_grasp(self.cycle, sight, state, random)


policy = Segment
