"""The height baseline: grasp the highest point (paper, section 6)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pscover.execution.sight import Sight
from pscover.policies._depth import check_radius, grasp_at_most
from pscover.policy import Decision, trip


@dataclass(frozen=True, slots=True, kw_only=True)
class Height:
    """The highest point of the cloth, the jaw along the first principal axis of the heights around it.

    Parameters
    ----------
    radius_cm
        How far "around it" reaches; the paper does not say, so the gripper's radius.

    Raises
    ------
    InvalidSettings
        If the radius is not positive.

    Examples
    --------
    >>> from pscover.execution.tabletop import small_table
    >>> pick, transport = Height().next(small_table().sight(), None, np.random.default_rng(0)).actions
    >>> pick.pose.x, pick.pose.y
    (40.0, 30.0)
    """

    name: ClassVar[str] = "height"
    needs_depth: ClassVar[bool] = True

    radius_cm: float = 4.25

    def __post_init__(self) -> None:
        check_radius(self.radius_cm)

    def next(self, sight: Sight, state: object | None, random: np.random.Generator) -> Decision:
        """One grasp."""
        pose = grasp_at_most(sight, sight.heights, self.radius_cm * sight.eyes.pixels_per_cm)
        return Decision(actions=trip(pose) if pose else ())


policy = Height
