"""The calls to a robot and a camera, each within a time limit if one is asked for, and a look at what they return."""

from __future__ import annotations

import math
import numbers
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from pscover.errors import InvalidImage, InvalidSettings
from pscover.policy import Action, Pick, Place
from pscover.robot import Camera, Frame, Robot, RobotFailed, Sorter

T = TypeVar("T")


class Hung(Exception):
    """A call did not return in time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hands:
    """A robot and a camera.

    Parameters
    ----------
    robot, camera
        The things themselves.
    seconds
        That a call may take. With a limit, calls are made in threads of their own, one at a time; one that hangs remains,
        for Python cannot end it, and keeps whatever locks the driver took.
    """

    robot: Robot
    camera: Camera
    seconds: float = math.inf

    def do(self, action: Action) -> None:
        """Make a motion.

        Raises
        ------
        RobotFailed
            As the robot does.
        Hung
            If it took too long.
        InvalidSettings
            If a basket is named and the robot has one only.
        """
        robot = self.robot
        match action:
            case Pick():
                self._called(lambda: robot.pick(action.pose), "pick")
            case Place():
                self._called(lambda: robot.place((action.x, action.y)), "place")
            case _ if action.basket == "":
                self._called(robot.transport, "transport")
            case _ if isinstance(robot, Sorter):
                self._called(lambda: robot.transport_to(action.basket), "transport")
            case _:
                raise InvalidSettings(
                    f"basket {action.basket!r}: expected a robot with `transport_to`, got {type(robot).__name__}"
                )

    def weight(self) -> float | None:
        """Kilograms held; None if the robot does not say, fails to, or says what no weight can be."""
        try:
            weight: Any = self._called(self.robot.weight, "weight")
        except RobotFailed:
            return None
        is_number = isinstance(weight, numbers.Real) and not isinstance(weight, bool)
        return float(weight) if is_number and 0 <= weight < math.inf else None

    def capture(self) -> Frame:
        """A frame.

        Raises
        ------
        RobotFailed
            As the camera does, if it gives something else, or if the picture is black: that shows no clear table.
        Hung
            If it took too long.
        """
        try:
            frame: Any = self._called(self.camera.capture, "capture")
        except InvalidImage as problem:
            raise RobotFailed(f"capture: {problem}") from problem
        if not isinstance(frame, Frame):
            raise RobotFailed(f"capture: expected a Frame, got {type(frame).__name__}")
        if not frame.rgb.any():
            raise RobotFailed("capture: expected a picture, got a black one")
        return frame

    def _called(self, call: Callable[[], T], what: str) -> T:
        return call() if math.isinf(self.seconds) else within(call, self.seconds, what)


def within(call: Callable[[], T], seconds: float, what: str) -> T:
    """What a call returns or raises, unless it takes longer.

    Raises
    ------
    Hung
        If it did not return in time; it goes on in its thread.

    Examples
    --------
    >>> within(lambda: 7, 5.0, "seven")
    7
    """
    done: list[T] = []
    raised: list[BaseException] = []

    def run() -> None:
        try:
            done.append(call())
        except BaseException as error:
            raised.append(error)

    thread = threading.Thread(target=run, name=f"pscover {what}", daemon=True)
    thread.start()
    thread.join(min(seconds, threading.TIMEOUT_MAX))
    if raised:
        raise raised[0]
    if not done:
        raise Hung(f"{what}: no return within {seconds:g} s")
    return done[0]
