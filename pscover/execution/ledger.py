"""What is known of a run so far: a value that follows from its events, so that a run can be taken up again from a record."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from pscover.execution.events import Captured, Decided, Empty, Event, Judged, MotionFailed, Moved, Retried, ScaleDoubted
from pscover.policy import Pick, Place, Transport
from pscover.robot import Pose

CHANGED = 0.34
"""What a grasp that changed the picture but took no cloth away counts as."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Strike:
    """A place where grasps came to nothing, and how often; one that changed the picture all the same counts a third."""

    x: float
    y: float
    times: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Ledger:
    """Counts and failures of a run.

    Parameters
    ----------
    decisions, picks, places, transports, empties, failures
        How many of each there were; `failures` are motions that failed, `empties` picks that hold nothing by their weight.
    failures_in_row
        Motions that failed since the last that did not.
    strikes
        Places where grasps came to nothing.
    least_cloth
        Fewest pixels of cloth seen so far.
    stalled
        Trips since then.
    retries
        How often all places were tried again.
    trusts_scale
        Whether the robot's weights are believed.
    undelivered
        The transport that failed, as long as nothing has moved since: what it was to take away is still held.
    """

    decisions: int = 0
    picks: int = 0
    places: int = 0
    transports: int = 0
    empties: int = 0
    failures: int = 0
    failures_in_row: int = 0
    strikes: tuple[Strike, ...] = ()
    least_cloth: float = math.inf
    stalled: int = 0
    retries: int = 0
    trusts_scale: bool = True
    undelivered: Transport | None = None

    def after(self, event: Event, same_place: float) -> Ledger:
        """The ledger with one more event; grasps closer than `same_place` pixels are at the same place.

        Examples
        --------
        >>> pose = Pose(x=5, y=5)
        >>> ledger = Ledger().after(Moved(action=Pick(pose=pose)), 10)
        >>> ledger = ledger.after(Judged(poses=(pose,), emptier=False, changed=False, cloth=80), 10)
        >>> ledger.picks, ledger.strikes, ledger.least_cloth
        (1, (Strike(x=5, y=5, times=1.0),), 80)
        """
        match event:
            case Captured() if math.isinf(self.least_cloth):
                return replace(self, least_cloth=event.cloth)
            case Decided():
                return replace(self, decisions=self.decisions + 1)
            case Moved():
                return self._moved(event)
            case MotionFailed():
                held = event.action if isinstance(event.action, Transport) else self.undelivered
                failures, in_row = self.failures + 1, self.failures_in_row + 1
                return replace(self, failures=failures, failures_in_row=in_row, undelivered=held)
            case Empty():
                return replace(self, empties=self.empties + 1)
            case ScaleDoubted():
                return replace(self, trusts_scale=False)
            case Judged():
                return self._judged(event, same_place)
            case Retried():
                return replace(self, strikes=(), retries=self.retries + 1)
            case _:
                return self

    def _moved(self, event: Moved) -> Ledger:
        match event.action:
            case Pick():
                return replace(self, picks=self.picks + 1, failures_in_row=0, undelivered=None)
            case Place():
                return replace(self, places=self.places + 1, failures_in_row=0, undelivered=None)
            case Transport():
                return replace(self, transports=self.transports + 1, failures_in_row=0, undelivered=None)

    def _judged(self, event: Judged, same_place: float) -> Ledger:
        less = event.cloth < self.least_cloth
        strikes = self.strikes
        if not event.emptier:
            for pose in event.poses:
                strikes = _struck(strikes, pose, same_place, CHANGED if event.changed else 1.0)
        return replace(
            self, strikes=strikes, least_cloth=min(event.cloth, self.least_cloth), stalled=0 if less else self.stalled + 1
        )

    def given_up(self, times: int) -> tuple[tuple[float, float], ...]:
        """The places that came to nothing at least so often."""
        return tuple((strike.x, strike.y) for strike in self.strikes if strike.times >= times)


def _struck(strikes: tuple[Strike, ...], pose: Pose, same_place: float, times: float) -> tuple[Strike, ...]:
    for k, strike in enumerate(strikes):
        if math.hypot(strike.x - pose.x, strike.y - pose.y) <= same_place:
            return (*strikes[:k], replace(strike, times=strike.times + times), *strikes[k + 1 :])
    return (*strikes, Strike(x=pose.x, y=pose.y, times=times))
