"""What happens while a table is cleared: each event is a value, so that it can be logged, drawn, kept and replayed."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from pscover.planning import Plan
from pscover.policy import Action, Pick, Skip
from pscover.robot import Frame, Pose
from pscover.seen import Seen


class Reason(StrEnum):
    """Why the clearing of a table ended."""

    CLEAR = "clear"
    """No cloth is seen any more."""
    LIMIT = "most transports reached"
    """The table may never clear, and the limit of trips came first."""
    STUCK = "no progress"
    """For too many trips in a row the table did not become emptier, or no grasp could be decided on."""
    BLIND = "no picture"
    """The camera gave no frame, however often it was asked."""
    BROKEN = "the robot keeps failing"
    """Too many motions in a row failed."""
    HUNG = "the robot hangs"
    """A motion or a capture did not return within the watchdog's time. Its thread still runs: Python cannot end it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Captured:
    """A picture was taken.

    Parameters
    ----------
    frame
        The picture.
    cloth
        Pixels of cloth in it.
    """

    frame: Frame
    cloth: int


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameLost:
    """The camera gave no usable picture; it will be asked again."""

    message: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Decided:
    """The next trip is known.

    Parameters
    ----------
    policy
        Who decided: the policy's name, or that of the one that stands in for it.
    actions
        What will be done.
    skipped
        Planned grasps that were given up.
    seen
        The garments, if a plan was made for this trip; else None.
    plan
        The plan, if one was made; None too when read from a record.
    seconds
        Wall time of looking and deciding.
    """

    policy: str
    actions: tuple[Action, ...]
    skipped: tuple[Skip, ...]
    seen: Seen | None
    plan: Plan | None
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PolicyFailed:
    """The policy could not decide, or not in time; a random grasp stands in."""

    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Moved:
    """A motion was made.

    Parameters
    ----------
    action
        Which.
    weight
        Kilograms that the robot says it holds after a pick; None if it does not say, or says nonsense.
    """

    action: Action
    weight: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionFailed:
    """The robot raised `RobotFailed`."""

    action: Action
    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Empty:
    """A pick holds nothing, by its weight; it is not carried."""

    pick: Pick


@dataclass(frozen=True, slots=True, kw_only=True)
class ScaleDoubted:
    """The weight said that nothing is held, but cloth is gone from the table: from now on everything is carried."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """A trip, held against the picture after it.

    Parameters
    ----------
    poses
        Where it grasped or tried to.
    emptier
        Whether there is less cloth than before.
    changed
        Whether the picture changed around one of the poses.
    cloth
        Pixels of cloth afterwards.
    """

    poses: tuple[Pose, ...]
    emptier: bool
    changed: bool
    cloth: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Retried:
    """Grasps failed everywhere; the places are tried again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """The last event.

    Parameters
    ----------
    reason
        Why.
    message
        More about it.
    """

    reason: Reason
    message: str = ""


Event = (
    Captured | FrameLost | Decided | PolicyFailed | Moved | MotionFailed | Empty | ScaleDoubted | Judged | Retried | Ended
)
