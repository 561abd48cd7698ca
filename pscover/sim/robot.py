"""The robot of a world: `pscover.robot.Robot`, in pixels of its camera."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pscover.robot import Pose, RobotFailed

if TYPE_CHECKING:
    from pscover.sim.world import World

LOW = 0.08
"""Metres above the table at which the fingers put down what they hold."""
REST = (0.25, 1.5)
"""Least and most seconds of physics after each release."""
FALL = (0.6, 2.0)
"""The same where garments fall into the basket, or off the table."""


@dataclass(frozen=True, slots=True, eq=False)
class ClothRobot:
    """Picks, places and transports in a world of cloth.

    A pick goes where the surface is seen in its pixel, as a calibrated camera with depth gives it. Raises `RobotFailed` for
    a point that is not above the table.
    """

    world: World

    def pick(self, pose: Pose) -> None:
        """Open, go down at the pose, close, and lift what is caught."""
        x, y = self._point(pose.x, pose.y)
        world, arm, clock = self.world, self.world.arm, self.world.clock
        lift = world.settings.gripper.lift
        if arm.visible:
            arm.open()
            arm.withdraw()
        clock.travel(world.parked, (x, y))
        clock.rise(lift - world.settings.gripper.tip)
        clock.jaw()
        clock.rise(lift - world.settings.gripper.tip)
        world.parked = (x, y)
        arm.close_at(x, y, pose.theta)
        if arm.held:
            arm.lift(lift)
        else:
            arm.withdraw()
            world.settle(*REST)

    def place(self, point: tuple[float, float]) -> None:
        """Take what is held to a point above the table, put it down and let go."""
        x, y = self._point(*point)
        world, arm, clock = self.world, self.world.arm, self.world.clock
        lift = world.settings.gripper.lift
        clock.travel(world.parked, (x, y))
        clock.rise(lift - LOW)
        clock.jaw()
        clock.rise(lift - LOW)
        world.parked = (x, y)
        if arm.visible:
            arm.move(x, y, lift)
            arm.move(x, y, LOW)
            arm.open()
            arm.withdraw()
        world.settle(*REST)

    def transport(self) -> None:
        """Take what is held to the basket and let go."""
        world, arm, clock = self.world, self.world.arm, self.world.clock
        x, y = world.settings.basket
        clock.travel(world.parked, (x, y))
        clock.jaw()
        world.parked = (x, y)
        if arm.visible:
            arm.move(x, y, world.settings.gripper.lift)
            arm.wait(0.15)
            arm.open()
            arm.withdraw()
            world.settle(*FALL)
        else:
            world.settle(*REST)

    def weight(self) -> float:
        """Kilograms that pull at the fingers, as a sensor in the wrist tells; what lies on the table weighs less."""
        return self.world.arm.weight

    def _point(self, x: float, y: float) -> tuple[float, float]:
        """Metres of the surface that is seen at a pixel."""
        world = self.world
        rows, columns = world.view.shape
        if not (math.isfinite(x) and math.isfinite(y) and -0.5 <= x <= columns - 0.5 and -0.5 <= y <= rows - 0.5):
            raise RobotFailed(f"expected a point of the image, {columns} x {rows} pixels, got x={x:.6g}, y={y:.6g}")
        _, depth = world.surface.labels(world.cloth, world.view)
        seen = float(depth[min(rows - 1, max(0, round(y))), min(columns - 1, max(0, round(x)))])
        table = world.settings.sensor.height
        mx, my, _ = world.view.point(x, y, seen if np.isfinite(seen) else table)
        return mx, my
