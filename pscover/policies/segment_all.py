"""The segment method over all poses instead of a random sample of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pscover.execution.sight import Sight
from pscover.policies._cycle import Cycle, next_grasp
from pscover.policy import Decision

ALL = Cycle(candidates="all")


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentAll:
    """The policy `segment`, every garment pixel and each orientation being a candidate.

    Where weighing all of them takes too long, candidates are drawn after all.

    Parameters
    ----------
    cycle
        How to plan, and when to skip.

    Examples
    --------
    >>> from pscover.execution.tabletop import small_table
    >>> decision = SegmentAll().next(small_table().sight(), None, np.random.default_rng(0))
    >>> decision.plan.scope.candidates, decision.plan.scope.poses
    ('all', 19800)
    """

    name: ClassVar[str] = "segment-all"
    needs_depth: ClassVar[bool] = False

    cycle: Cycle = ALL

    def next(self, sight: Sight, state: object | None, random: np.random.Generator) -> Decision:
        """The next grasp of the plan."""
        return next_grasp(self.cycle, sight, state, random)


policy = SegmentAll
