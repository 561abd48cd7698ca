"""Drive a robot until the table is clear: look, decide, move, look again; and go on when something fails."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Generator, Iterator
from dataclasses import dataclass, field

import numpy as np

from pscover.errors import InvalidImage, InvalidSettings, MissingDependency, PscoverError, UnknownName
from pscover.execution.events import (
    Captured,
    Decided,
    Empty,
    Ended,
    Event,
    FrameLost,
    Judged,
    MotionFailed,
    Moved,
    PolicyFailed,
    Reason,
    Retried,
    ScaleDoubted,
)
from pscover.execution.hands import Hands, Hung
from pscover.execution.ledger import Ledger
from pscover.execution.sight import BoolImage, Eyes, PhotoEyes, Sight
from pscover.execution.sound import check_decision
from pscover.policies._blind import anywhere
from pscover.policies._cycle import change
from pscover.policy import Decision, Pick, Place, Policy, Transport, trip
from pscover.robot import Camera, Frame, Pose, Robot, RobotFailed


@dataclass(frozen=True, slots=True, kw_only=True)
class Patience:
    """When to carry a grasp, when to call a place hopeless, and when to stop.

    Parameters
    ----------
    clear_cm2
        The table is clear when less cloth than this is seen.
    empty_kilograms
        A pick that weighs less holds nothing and is not carried. 0 carries every pick, as a robot without a scale does.
    most_transports
        Trips after which to stop, whatever lies on the table.
    stalled_trips
        Trips without less cloth than ever before, after which to stop.
    tries
        Grasps at one place that come to nothing, after which it is left alone.
    place_cm
        Grasps so close to each other are at the same place.
    progress_cm2
        A trip made progress if so much cloth is gone.
    threshold
        Or if the picture changed by so much around one of its grasps: mean squared difference, in squared grey levels.
    retries
        How often all hopeless places are tried again once no others are left.
    captures
        How often the camera is asked for a picture.
    failures
        Motions that fail in a row, after which to stop.
    watchdog
        Seconds that a motion or a capture may take; infinite waits for ever. A call that hangs cannot be ended from within
        the process: `declutter` returns, but the thread that made the call remains.

    Raises
    ------
    InvalidSettings
        If a number is outside its domain.
    """

    clear_cm2: float = 5.0
    empty_kilograms: float = 0.005
    most_transports: int = 200
    stalled_trips: int = 20
    tries: int = 2
    place_cm: float = 2.0
    progress_cm2: float = 5.0
    threshold: float = 400.0
    retries: int = 1
    captures: int = 3
    failures: int = 10
    watchdog: float = math.inf

    def __post_init__(self) -> None:
        for name in ("clear_cm2", "empty_kilograms", "place_cm", "progress_cm2", "threshold", "retries"):
            if not getattr(self, name) >= 0:
                raise InvalidSettings(f"{name}: expected a number of at least 0, got {getattr(self, name)!r}")
        for name in ("most_transports", "stalled_trips", "tries", "captures", "failures", "watchdog"):
            if not getattr(self, name) > 0:
                raise InvalidSettings(f"{name}: expected a positive number, got {getattr(self, name)!r}")
        for name in ("tries", "captures"):
            if not isinstance(getattr(self, name), int):
                raise InvalidSettings(f"{name}: expected a whole number, got {getattr(self, name)!r}")


PATIENCE = Patience()


def declutter(
    robot: Robot,
    camera: Camera,
    policy: Policy,
    *,
    eyes: Eyes | None = None,
    patience: Patience = PATIENCE,
    seed: int = 0,
    ledger: Ledger | None = None,
) -> Iterator[Event]:
    """Clear the table, one trip after the other.

    A picture is taken, the policy decides on a trip, the robot makes it, and the next picture says what came of it.
    What a robot or a camera reports as `RobotFailed` ends neither the run nor the trip; any other exception of theirs
    is the caller's and passes through. Between any two events the caller may stop by not asking for the next: nothing is
    left running then, and the robot holds what it held.

    Parameters
    ----------
    robot, camera
        One's own, or those of a simulation.
    policy
        Who decides. If it raises a `PscoverError`, sees nothing to do where cloth lies, or decides on something that is no
        trip, a random grasp stands in.
    eyes
        What looks at the frames; by default `PhotoEyes()`.
    patience
        When to give up what.
    seed
        Of everything random. With equal seeds and frames, equal decisions follow, as far as plans do not depend on the
        machine's speed: see `pscover.policies._cycle.Cycle`.
    ledger
        Of a run that is taken up again (see `pscover.execution.episode`); by default that of a new one.

    Yields
    ------
    Event
        As they happen; the last is `Ended`.

    Raises
    ------
    InvalidSettings, UnknownName, MissingDependency
        If the policy cannot work as it is set up, for then no other picture helps.

    Examples
    --------
    >>> from pscover.policies.segment import Segment
    >>> from pscover.execution.tabletop import ColourEyes, small_table
    >>> table = small_table()
    >>> events = list(declutter(table, table, Segment(), eyes=ColourEyes()))
    >>> str(events[-1].reason), sorted(label for _, label in table.baskets)
    ('clear', [1, 2, 3])
    """
    if seed < 0:
        raise InvalidSettings(f"seed: expected a whole number of at least 0, got {seed!r}")
    run = _Run(
        hands=Hands(robot=robot, camera=camera, seconds=patience.watchdog),
        policy=policy,
        eyes=eyes or PhotoEyes(),
        patience=patience,
        seed=seed,
        ledger=ledger or Ledger(),
    )
    for event in run.events():
        # The ledger knows of an event before the caller does, who may never ask for the next.
        run.ledger = run.ledger.after(event, run.pixels(patience.place_cm))
        yield event


@dataclass(slots=True, kw_only=True)
class _Run:
    """A run under way."""

    hands: Hands
    policy: Policy
    eyes: Eyes
    patience: Patience
    seed: int
    ledger: Ledger
    tried: list[Pose] = field(default_factory=list)
    doubtful: bool = False
    """Whether the last pick holds nothing, by its weight."""
    state: object | None = None
    frame: Frame | None = None
    cloth_map: BoolImage | None = None
    """Which pixels of the frame show cloth."""
    cloth: int = 0
    """How many of them."""

    def pixels(self, centimetres: float) -> float:
        return centimetres * self.eyes.pixels_per_cm

    def events(self) -> Iterator[Event]:
        try:
            yield from self._look()
            self._check_depth()
            while self.frame is not None:
                sight = self._sight(self.frame)
                reason = self._reason_to_end(sight)
                if reason is not None:
                    yield Ended(reason=reason, message=self._told())
                    return
                before, cloth = self.frame, self.cloth
                yield from self._trip(sight)
                if self.frame is not None:
                    yield self._judge(before, cloth)
            yield Ended(reason=Reason.BLIND, message=f"asked {self.patience.captures} times")
        except Hung as hung:
            yield Ended(reason=Reason.HUNG, message=str(hung))

    def _check_depth(self) -> None:
        if self.frame is not None and self.frame.depth is None and self.policy.needs_depth:
            raise InvalidSettings(
                f"policy {self.policy.name!r}: expected frames with depth, got none; use one that needs no depth camera"
            )

    def _trip(self, sight: Sight) -> Iterator[Event]:
        cloth, undelivered = self.cloth, self.ledger.undelivered
        if self._is_clear() and undelivered is not None:
            # The last of it is in the gripper.
            self.tried = []
            yield from self._carry(undelivered)
            yield from self._look()
            return
        if not sight.free.any():
            yield Retried()
            sight = self._sight(sight.frame)
        decision = yield from self._decide(sight)
        yield from self._move(decision)
        yield from self._look()
        yield from self._check_scale(cloth, decision)

    def _sight(self, frame: Frame) -> Sight:
        failed = self.ledger.given_up(self.patience.tries)
        return Sight(frame, self.eyes, failed, self.pixels(self.patience.place_cm), self.cloth_map)

    def _reason_to_end(self, sight: Sight) -> Reason | None:
        patience, ledger = self.patience, self.ledger
        if self._is_clear() and ledger.undelivered is None:
            return Reason.CLEAR
        if ledger.transports >= patience.most_transports:
            return Reason.LIMIT
        if ledger.failures_in_row >= patience.failures:
            return Reason.BROKEN
        if ledger.stalled >= patience.stalled_trips:
            return Reason.STUCK
        if not self._is_clear() and not sight.free.any() and ledger.retries >= patience.retries:
            return Reason.STUCK
        return None

    def _is_clear(self) -> bool:
        return self.cloth == 0 or self.cloth < self._square_pixels(self.patience.clear_cm2)

    def _told(self) -> str:
        held = "" if self.ledger.undelivered is None else ", the last trip did not reach the basket"
        return f"{self.ledger.transports} transports, {self.cloth} pixels of cloth left{held}"

    def _square_pixels(self, cm2: float) -> float:
        return cm2 * self.eyes.pixels_per_cm**2

    def _look(self) -> Iterator[Event]:
        """Take a picture; without one, `frame` is None."""
        shape = None if self.frame is None else self.frame.shape
        self.frame = None
        for _ in range(self.patience.captures):
            try:
                frame = self.hands.capture()
                if shape is not None and frame.shape != shape:
                    raise RobotFailed(f"expected a frame of shape {shape}, as before, got {frame.shape}")
                self.cloth_map = self.eyes.cloth(frame)
            except (RobotFailed, InvalidImage) as problem:
                yield FrameLost(message=str(problem))
                continue
            self.frame, self.cloth = frame, int(np.count_nonzero(self.cloth_map))
            yield Captured(frame=frame, cloth=self.cloth)
            return

    def _decide(self, sight: Sight) -> Generator[Event, None, Decision]:
        began = clock.monotonic()
        random = np.random.default_rng([self.seed, self.ledger.decisions])
        name = self.policy.name
        try:
            decision = self.policy.next(sight, self.state, random)
            check_decision(decision, sight.frame.shape)
        except (InvalidSettings, UnknownName, MissingDependency):
            raise
        except PscoverError as problem:
            decision = Decision(actions=())
            yield PolicyFailed(message=str(problem))
        if not decision.actions:
            pose = anywhere(sight, random)
            assert pose is not None
            name, decision = "random", Decision(actions=trip(pose), skipped=decision.skipped, plan=decision.plan)
        self.state = decision.state
        yield Decided(
            policy=name,
            actions=decision.actions,
            skipped=decision.skipped,
            seen=None if decision.plan is None else decision.plan.seen,
            plan=decision.plan,
            seconds=clock.monotonic() - began,
        )
        return decision

    def _move(self, decision: Decision) -> Iterator[Event]:
        """Make a trip. What is not held is neither placed nor carried."""
        self.tried, self.doubtful, holds = [], False, False
        for action in decision.actions:
            if isinstance(action, Pick):
                self.tried.append(action.pose)
                # After a failed place the robot still holds what it was to put down, and lets go of it as it picks.
                holds = yield from self._pick(action)
            elif holds:
                yield from self._carry(action)
                holds = False

    def _pick(self, pick: Pick) -> Generator[Event, None, bool]:
        """Pick, and return whether something is held, as far as is known."""
        try:
            self.hands.do(pick)
        except RobotFailed as problem:
            yield MotionFailed(action=pick, message=str(problem))
            return False
        weight = self.hands.weight()
        yield Moved(action=pick, weight=weight)
        self.doubtful = self.ledger.trusts_scale and weight is not None and weight < self.patience.empty_kilograms
        if self.doubtful:
            yield Empty(pick=pick)
        return not self.doubtful

    def _carry(self, action: Place | Transport) -> Iterator[Event]:
        for _ in range(self.patience.tries if isinstance(action, Transport) else 1):
            try:
                self.hands.do(action)
            except RobotFailed as problem:
                yield MotionFailed(action=action, message=str(problem))
                continue
            yield Moved(action=action)
            return

    def _check_scale(self, cloth: int, decision: Decision) -> Iterator[Event]:
        """If the last pick holds nothing by its weight and yet cloth is gone, carry it, and believe the scale no more."""
        if self.doubtful and self.frame is not None and self._is_emptier(cloth):
            yield ScaleDoubted()
            yield from self._carry(next(action for action in decision.actions if isinstance(action, Transport)))
            yield from self._look()

    def _is_emptier(self, cloth: int) -> bool:
        return cloth - self.cloth >= max(1.0, self._square_pixels(self.patience.progress_cm2))

    def _judge(self, before: Frame, cloth: int) -> Judged:
        assert self.frame is not None
        side = 2 * self.pixels(self.patience.place_cm)
        differences = [change(before.rgb, self.frame.rgb, pose, side) for pose in self.tried]
        return Judged(
            poses=tuple(self.tried),
            emptier=self._is_emptier(cloth),
            changed=any(difference > self.patience.threshold for difference in differences),
            cloth=self.cloth,
        )
