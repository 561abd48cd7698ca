"""The robot's clock: how long a real arm would take for what the simulated one does."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pscover.sim.settings import Pace


@dataclass(slots=True)
class Clock:
    """Seconds of the robot, by its pace.

    Examples
    --------
    >>> clock = Clock(Pace(transit=0.5, settle=0.1))
    >>> clock.travel((0.0, 0.0), (0.3, 0.4))
    >>> round(clock.seconds, 9)
    1.1
    """

    pace: Pace
    seconds: float = 0.0

    def travel(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Level with the table."""
        self.seconds += math.dist(start, end) / self.pace.transit + self.pace.settle

    def rise(self, metres: float) -> None:
        """Up or down."""
        self.seconds += abs(metres) / self.pace.vertical + self.pace.settle

    def jaw(self) -> None:
        """Close or open."""
        self.seconds += self.pace.close

    def capture(self) -> None:
        """One image."""
        self.seconds += self.pace.capture
