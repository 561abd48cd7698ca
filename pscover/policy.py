"""The contract of a policy: from what is seen to what the robot does until it next goes to the basket.

A policy is a value. It moves nothing and remembers nothing: what it must know the next time it hands back as a state.
So it is tested without a robot, and a run can be repeated. Policies live in `pscover/policies/`, one file each.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from pscover.execution.sight import Sight
from pscover.planning import Plan
from pscover.robot import Pose


@dataclass(frozen=True, slots=True, kw_only=True)
class Pick:
    """Close the gripper at a pose and lift."""

    pose: Pose


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Put what is held down at a point, in pixels."""

    x: float
    y: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Transport:
    """Take what is held to a basket; "" is the only one, or any."""

    basket: str = ""


Action = Pick | Place | Transport


@dataclass(frozen=True, slots=True, kw_only=True)
class Skip:
    """A planned grasp that is left out, for the picture around it has changed.

    Parameters
    ----------
    pose
        Where it would have been.
    change
        Mean squared difference of the pixels around it, in squared grey levels.
    """

    pose: Pose
    change: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Decision:
    """What to do next, and what to remember.

    Parameters
    ----------
    actions
        One trip: picks, places between them, a transport at the end. Empty if the policy sees nothing to do.
    state
        To be given back at the next call, after the trip; None starts afresh.
    skipped
        Grasps of the plan that were given up before this trip.
    plan
        The plan, if one was made for this trip.
    """

    actions: tuple[Action, ...]
    state: object | None = None
    skipped: tuple[Skip, ...] = ()
    plan: Plan | None = None


class Policy(Protocol):
    """Decides what the robot does. Implementations are frozen dataclasses whose fields are their settings, with defaults.

    Attributes
    ----------
    name
        As used on the command line; the file's name with hyphens.
    needs_depth
        Whether frames must have depth.
    """

    name: ClassVar[str]
    needs_depth: ClassVar[bool]

    def next(self, sight: Sight, state: object | None, random: np.random.Generator) -> Decision:
        """The next trip.

        Parameters
        ----------
        sight
            What is seen now, and where grasps have failed.
        state
            That of the last decision; None, or anything that is not this policy's, starts afresh.
        random
            The only source of randomness: the same three arguments give the same decision.

        Raises
        ------
        PscoverError
            If nothing could be decided.
        """
        ...


def trip(*poses: Pose, basket: str = "") -> tuple[Action, ...]:
    """Picks in order, each but the first where what was held is put down, and the transport.

    Examples
    --------
    >>> [type(action).__name__ for action in trip(Pose(x=9, y=9), Pose(x=5, y=5))]
    ['Pick', 'Place', 'Pick', 'Transport']
    """
    actions: list[Action] = []
    for pose in poses:
        if actions:
            actions.append(Place(x=pose.x, y=pose.y))
        actions.append(Pick(pose=pose))
    return (*actions, Transport(basket=basket)) if actions else ()
