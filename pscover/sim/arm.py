"""The arm: motions of the hand through the cloth, in metres."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pscover.sim.cloth import Cloth, Law
from pscover.sim.contact import Near
from pscover.sim.fingers import COSINE, GAP, RESISTANCE, SINE, Hand, Move, X, Y, Z
from pscover.sim.grip import grasp, let_go
from pscover.sim.settings import Gripper
from pscover.sim.step import advance

SPEED = 0.6
"""Metres a second of the hand in the physics: as fast as hanging cloth follows without flying."""
CLOSING = 0.22
"""Metres a second at which the jaw closes or opens."""
ABOVE = 0.16
"""Metres above the table at which the hand begins to go down through the cloth."""
SLICE = 16
"""Steps between two looks of whoever watches."""
ASIDE = (0.5, 0.3, 1.2)
"""Where the hand is out of the way."""


@dataclass(slots=True, kw_only=True, eq=False)
class Arm:
    """The hand and what moves it.

    Parameters
    ----------
    cloth, pairs, hand, law
        The state of the world.
    gripper
        The jaw's measures.
    watch
        Called with the seconds of physics that have just passed.
    """

    cloth: Cloth
    pairs: Near
    hand: Hand
    law: Law
    gripper: Gripper
    watch: Callable[[float], None]
    visible: bool = field(default=False)

    @property
    def at(self) -> tuple[float, float, float]:
        """Middle between the tips, metres."""
        x, y, z = self.hand.state[[X, Y, Z]].tolist()
        return x, y, z

    @property
    def held(self) -> tuple[int, ...]:
        """Garments between the fingers, ascending."""
        return tuple(np.unique(self.cloth.garment[self.hand.held == 1]).tolist())

    @property
    def weight(self) -> float:
        """Kilograms that pull down at the held particles, with these."""
        held = self.hand.held == 1
        pull = -float(self.hand.load[held, 2].sum()) / -self.law.gravity_z
        return max(0.0, pull + float(self.cloth.mass[held].sum()))

    def close_at(self, x: float, y: float, theta: float) -> NDArray[np.int64]:
        """Appear open above a point, go down to the fixed height, and close; returns the particles held."""
        jaw, state = self.gripper, self.hand.state
        state[[X, Y, Z, GAP, COSINE, SINE, RESISTANCE]] = x, y, ABOVE, jaw.opening, math.cos(theta), math.sin(theta), 0.0
        self.visible = True
        self.move(x, y, jaw.tip)
        self._jaw(jaw.closed)
        return grasp(self.cloth, self.hand, self.law, jaw.grip)

    def lift(self, z: float) -> None:
        """Straight up, and wait until what hangs there hangs still."""
        x, y, _ = self.at
        self.move(x, y, z)
        self.wait(0.15)

    def move(self, x: float, y: float, z: float) -> None:
        """In a straight line."""
        here = np.array(self.at)
        way = float(np.linalg.norm(np.array([x, y, z]) - here))
        # The fastest moment of a motion without jerk is 15/8 of its mean speed.
        self._go(x, y, z, float(self.hand.state[GAP]), 1.3 * way / SPEED, solid=min(z, here[2]) < 0.3)

    def open(self) -> None:
        """Let go of everything."""
        let_go(self.cloth, self.hand)
        x, y, z = self.at
        self._go(x, y, z, self.gripper.opening, (self.gripper.opening - self.hand.state[GAP]) / CLOSING, solid=z < 0.3)

    def withdraw(self) -> None:
        """Out of the way, upwards."""
        x, y, z = self.at
        if z < ABOVE:
            self.move(x, y, ABOVE)
        self.hand.state[[X, Y, Z]] = ASIDE
        self.visible = False

    def wait(self, seconds: float) -> None:
        """Where it is."""
        x, y, z = self.at
        self._go(x, y, z, float(self.hand.state[GAP]), seconds, solid=z < 0.3)

    def settle(self, least: float, most: float) -> None:
        """Let cloth come to rest: until every garment sleeps, but between `least` and `most` seconds."""
        seconds = 0.0
        while seconds < most and (seconds < least or self._restless()):
            self.wait(SLICE * self.law.dt)
            seconds += SLICE * self.law.dt

    def _restless(self) -> bool:
        return bool((self.cloth.asleep[self.cloth.present == 1] == 0).any())

    def _jaw(self, gap: float) -> None:
        x, y, z = self.at
        self._go(x, y, z, gap, 1.15 * (self.gripper.opening - gap) / CLOSING, solid=True)

    def _go(self, x: float, y: float, z: float, gap: float, seconds: float, *, solid: bool) -> None:
        steps = max(1, round(seconds / self.law.dt))
        from_x, from_y, from_z = self.at
        move = Move(
            from_x=from_x,
            from_y=from_y,
            from_z=from_z,
            x=x,
            y=y,
            z=z,
            steps=steps,
            gap=gap,
            speed=CLOSING,
            force=self.gripper.force,
            closed=self.gripper.closed,
            solid=float(solid),
        )
        for first in range(0, steps, SLICE):
            last = min(steps, first + SLICE)
            advance(self.cloth, self.pairs, self.hand, self.law, move, first, last)
            self.watch((last - first) * self.law.dt)
