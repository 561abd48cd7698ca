"""The volume baseline: grasp where most cloth lies within reach (paper, section 6)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pscover.execution.sight import Sight
from pscover.policies._depth import check_radius, disc_sums, grasp_at_most
from pscover.policy import Decision, trip


@dataclass(frozen=True, slots=True, kw_only=True)
class Volume:
    """The point whose disc holds the largest sum of heights, the jaw along the principal axis of the heights in it.

    Parameters
    ----------
    radius_cm
        R, of the disc; the gripper's radius by default.

    Raises
    ------
    InvalidSettings
        If the radius is not positive.

    Examples
    --------
    >>> from pscover.execution.tabletop import small_table
    >>> pick, transport = Volume().next(small_table().sight(), None, np.random.default_rng(0)).actions
    >>> pick.pose.x, pick.pose.y
    (30.0, 30.0)
    """

    name: ClassVar[str] = "volume"
    needs_depth: ClassVar[bool] = True

    radius_cm: float = 4.25

    def __post_init__(self) -> None:
        check_radius(self.radius_cm)

    def next(self, sight: Sight, state: object | None, random: np.random.Generator) -> Decision:
        """One grasp."""
        radius = self.radius_cm * sight.eyes.pixels_per_cm
        sums = disc_sums(np.where(sight.cloth, sight.heights, 0.0), radius)
        pose = grasp_at_most(sight, sums, radius)
        return Decision(actions=trip(pose) if pose else ())


policy = Volume
