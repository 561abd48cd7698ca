"""Whether what a policy decided on is a trip that a robot can make."""

from __future__ import annotations

import math

from pscover.errors import PscoverError
from pscover.policy import Decision, Pick, Place, Transport


class UnsoundDecision(PscoverError):
    """A policy answered with something that is no trip."""


def check_decision(decision: object, shape: tuple[int, int]) -> None:
    """Raise `UnsoundDecision` unless a decision is empty, or picks first, transports last and stays within the picture.

    Parameters
    ----------
    decision
        Whatever a policy returned.
    shape
        Rows and columns of the frame.

    Examples
    --------
    >>> from pscover.policy import trip
    >>> from pscover.robot import Pose
    >>> check_decision(Decision(actions=trip(Pose(x=7, y=2))), (10, 20))
    >>> check_decision(Decision(actions=trip(Pose(x=70, y=2))), (10, 20))
    Traceback (most recent call last):
    pscover.execution.sound.UnsoundDecision: decision: expected points within 20 x 10 pixels, got (70, 2)
    """
    if not isinstance(decision, Decision):
        raise UnsoundDecision(f"decision: expected a Decision, got {type(decision).__name__}")
    kinds = [type(action) for action in decision.actions]
    for kind in kinds:
        if kind not in (Pick, Place, Transport):
            raise UnsoundDecision(f"decision: expected picks, places and a transport, got {kind.__name__}")
    if kinds and (kinds[0] is not Pick or kinds[-1] is not Transport or kinds.count(Transport) > 1):
        told = ", ".join(kind.__name__ for kind in kinds)
        raise UnsoundDecision(f"decision: expected a pick first and one transport, at the end, got {told}")
    for action in decision.actions:
        if not isinstance(action, Transport):
            _check_point(action, shape)


def _check_point(action: Pick | Place, shape: tuple[int, int]) -> None:
    height, width = shape
    x, y = (action.pose.x, action.pose.y) if isinstance(action, Pick) else (action.x, action.y)
    is_within = math.isfinite(x) and math.isfinite(y) and -0.5 <= x <= width - 0.5 and -0.5 <= y <= height - 0.5
    if not is_within:
        raise UnsoundDecision(f"decision: expected points within {width} x {height} pixels, got ({x:g}, {y:g})")
