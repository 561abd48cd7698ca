"""Hybrid (height): take down tall piles by depth, plan the rest by segments (paper, section 6)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pscover.execution.sight import Sight
from pscover.policies._cycle import CYCLE, Cycle
from pscover.policies._hybrid import check_pile, depth_or_segments
from pscover.policies.height import Height
from pscover.policy import Decision

HEIGHT = Height()


@dataclass(frozen=True, slots=True, kw_only=True)
class HybridHeight:
    """One grasp of the policy `height` while the tallest pile exceeds a height, else one cycle of the policy `segment`.

    Parameters
    ----------
    pile_metres
        The height.
    height
        The grasps on piles.
    cycle
        The others.

    Raises
    ------
    InvalidSettings
        If the height is negative.

    Examples
    --------
    >>> from pscover.execution.tabletop import small_table
    >>> sight, random = small_table().sight(), np.random.default_rng(0)
    >>> [HybridHeight(pile_metres=metres).next(sight, None, random).plan is None for metres in (0.1, 0.0)]
    [False, True]
    """

    name: ClassVar[str] = "hybrid-height"
    needs_depth: ClassVar[bool] = True

    pile_metres: float = 0.1
    height: Height = HEIGHT
    cycle: Cycle = CYCLE

    def __post_init__(self) -> None:
        check_pile(self.pile_metres)

    def next(self, sight: Sight, state: object | None, random: np.random.Generator) -> Decision:
        """The next grasp, of whichever method it is the turn."""
        return depth_or_segments(self.height, self.cycle, self.pile_metres, sight, state, random)


policy = HybridHeight
