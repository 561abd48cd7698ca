"""The random baseline (paper, section 6)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pscover.execution.sight import Sight
from pscover.policies._blind import anywhere
from pscover.policy import Decision, trip


@dataclass(frozen=True, slots=True, kw_only=True)
class Random:
    """A uniform garment pixel, a uniform angle; a new image for each grasp.

    Examples
    --------
    >>> from pscover.execution.tabletop import small_table
    >>> len(Random().next(small_table().sight(), None, np.random.default_rng(0)).actions)
    2
    """

    name: ClassVar[str] = "random"
    needs_depth: ClassVar[bool] = False

    def next(self, sight: Sight, state: object | None, random: np.random.Generator) -> Decision:
        """One grasp."""
        pose = anywhere(sight, random)
        return Decision(actions=trip(pose) if pose else ())


policy = Random
