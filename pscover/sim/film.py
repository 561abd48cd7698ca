"""Frames of the world in motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pscover.robot import Frame

if TYPE_CHECKING:
    from pscover.sim.view import Projection
    from pscover.sim.world import World


@dataclass(slots=True, kw_only=True, eq=False)
class Film:
    """Shows a frame whenever so much time has passed in the physics.

    Parameters
    ----------
    world
        What is filmed.
    show
        Called with each frame.
    period
        Seconds between frames.
    view
        From where.
    """

    world: World
    show: Callable[[Frame], object]
    period: float
    view: Projection
    passed_since: float = 0.0

    def passed(self, seconds: float) -> None:
        """Count time, and show a frame if one is due."""
        self.passed_since += seconds
        if self.passed_since >= self.period:
            self.passed_since %= self.period
            arm = self.world.arm
            picture = self.world.painter.picture(self.world.cloth, self.view, arm.hand if arm.visible else None)
            self.show(Frame(rgb=picture.rgb()))
