"""One episode: a policy clears the scene of a seed, and what came of it is counted."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pscover import registry
from pscover.execution.declutter import PATIENCE, Patience, declutter
from pscover.execution.episode import Header, Recorder, discard
from pscover.execution.events import Decided, Ended, Event, MotionFailed, Moved
from pscover.experiment.worlds import Kind, Sorting, World, opened
from pscover.grasping.calibrated import Calibrated
from pscover.policy import Pick, Place, Policy, Transport

ENGINE = "highs"
"""Of the policies that plan. `auto` goes by the clock, and by whether its kernels are loaded yet: which of several best
plans it finds differs from process to process, and an experiment that is taken up again would end with other tables."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """What to run.

    Parameters
    ----------
    policy, options
        Its name, and its settings as text. Plans are made by `ENGINE` unless they name another.
    seed
        Of the scene, and of the policy.
    world, segmenter
        See `pscover.experiment.worlds.opened`.
    cache
        Folder in which scenes are kept, or "".
    record
        Folder for a record of the episode (see `pscover.execution.episode`), or "" for none.
    film
        File for an animated GIF of the episode, or "" for none (see `pscover.experiment.filming`).
    predictor
        Fitted numbers for policies that plan by segments; None for the paper's.
    patience
        Of `declutter`. By default every pick is carried, as by the paper's robot, which had no scale.
    """

    policy: str
    options: tuple[tuple[str, str], ...] = ()
    seed: int = 0
    world: Kind = "cloth"
    segmenter: str = "classical"
    cache: str = ""
    record: str = ""
    film: str = ""
    predictor: Calibrated | None = None
    patience: Patience = field(default_factory=lambda: replace(PATIENCE, empty_kilograms=0.0))

    @property
    def settings(self) -> dict[str, str]:
        """The settings that the policy is made with, as text."""
        return {"backend": ENGINE, **dict(self.options)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What came of a trial: nothing in it depends on the speed of the computer, unless a plan was cut off by its deadline.

    Parameters
    ----------
    policy, seed
        Of the trial.
    garments
        On the table at first.
    carried
        Garments in the basket after each trip, less those before.
    picks, places, failures
        Motions made, and motions that failed. Places are the paper's rearrangements.
    stand_ins
        Trips by a random grasp in the policy's stead: it failed, or saw nothing to do where cloth lay.
    fallen
        Garments that fell off the table, which a person took away; they count for nobody.
    left
        Garments on the table at the end.
    seconds
        Of the robot's clock, without computing.
    reason
        Why the episode ended.
    """

    policy: str
    seed: int
    garments: int
    carried: tuple[int, ...]
    picks: int
    places: int
    failures: int
    stand_ins: int
    fallen: int
    left: int
    seconds: float
    reason: str

    @property
    def removed(self) -> int:
        """Garments in the basket."""
        return sum(self.carried)

    @property
    def trips(self) -> int:
        """Transports, those with nothing too."""
        return len(self.carried)

    @property
    def empty(self) -> int:
        """Transports with nothing."""
        return sum(count == 0 for count in self.carried)

    @property
    def opt(self) -> float:
        """Objects per transport (the paper's measure): garments removed / trips to the basket; NaN without a trip.

        Examples
        --------
        >>> one = dict(policy="random", seed=0, garments=5, fallen=0, left=0, seconds=90, reason="clear")
        >>> outcome = Outcome(carried=(2, 0, 1, 2), picks=4, places=0, failures=0, stand_ins=0, **one)
        >>> outcome.opt, outcome.opt_without_empty, outcome.pph
        (1.25, 1.6666666666666667, 200.0)
        """
        return self.removed / self.trips if self.trips else math.nan

    @property
    def opt_without_empty(self) -> float:
        """The same, where trips with nothing are not counted."""
        return self.removed / (self.trips - self.empty) if self.removed else math.nan

    @property
    def pph(self) -> float:
        """Garments removed an hour of the robot's clock."""
        return 3600 * self.removed / self.seconds if self.seconds else math.nan


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Wall seconds of a trial on this computer: of looking and deciding, and of everything, a simulation's physics too."""

    deciding: float
    total: float


def policy_of(trial: Trial) -> Policy:
    """The policy with its settings and predictor; settings that only other policies have are left out.

    Raises
    ------
    UnknownName, InvalidSettings
        If there is no such policy, or a value is outside its domain.
    """
    known = registry.policy_settings(trial.policy)
    policy: Any = registry.policy(trial.policy, {name: value for name, value in trial.settings.items() if name in known})
    if trial.predictor is not None and hasattr(policy, "cycle"):
        policy = replace(policy, cycle=replace(policy.cycle, predictor=trial.predictor))
    made: Policy = policy
    return made


def run(trial: Trial) -> tuple[Outcome, Timing]:
    """Run a trial to its end.

    Examples
    --------
    >>> outcome, _ = run(Trial(policy="random", world="tabletop"))
    >>> outcome.reason, outcome.garments, outcome.removed
    ('clear', 10, 10)
    """
    began = clock.perf_counter()
    policy = policy_of(trial)
    cache = Path(trial.cache) if trial.cache else None
    world = opened(trial.world, trial.seed, segmenter=trial.segmenter, cache=cache)
    first = world.count()
    carried: list[int] = []
    picks = places = failures = stand_ins = 0
    deciding, reason, so_far = 0.0, "", 0
    with ExitStack() as stack:
        watchers = _watchers(trial, world, stack)
        for event in declutter(
            Sorting(world.robot), world.camera, policy, eyes=world.eyes, patience=trial.patience, seed=trial.seed
        ):
            for watch in watchers:
                watch(event)
            match event:
                case Moved(action=Transport()):
                    now = world.count().in_basket
                    carried.append(now - so_far)
                    so_far = now
                case Moved(action=Pick()):
                    picks += 1
                case Moved(action=Place()):
                    places += 1
                case MotionFailed():
                    failures += 1
                case Decided():
                    deciding += event.seconds
                    stand_ins += event.policy != policy.name
                case Ended():
                    reason = str(event.reason)
                case _:
                    pass
    last = world.count()
    outcome = Outcome(
        policy=trial.policy,
        seed=trial.seed,
        garments=first.on_table,
        carried=tuple(carried),
        picks=picks,
        places=places,
        failures=failures,
        stand_ins=stand_ins,
        fallen=last.off_table,
        left=last.on_table,
        seconds=world.seconds(),
        reason=reason,
    )
    return outcome, Timing(deciding=deciding, total=clock.perf_counter() - began)


def _watchers(trial: Trial, world: World, stack: ExitStack) -> list[Callable[[Event], None]]:
    """What else takes the events; the stack ends it."""
    watchers: list[Callable[[Event], None]] = []
    if trial.record:
        watchers.append(stack.enter_context(_recorder(trial, world.eyes.pixels_per_cm)).write)
    if trial.film:
        from pscover.experiment.filming import filmed

        watchers.append(stack.enter_context(filmed(world, trial.policy, Path(trial.film))))
    return watchers


def _recorder(trial: Trial, pixels_per_cm: float) -> Recorder:
    folder = Path(trial.record) / trial.policy / f"{trial.seed:04d}"
    # An episode that was cut off begins anew: a simulated world cannot be taken up in the middle.
    discard(folder)
    header = Header(policy=trial.policy, options=trial.settings, seed=trial.seed, pixels_per_cm=pixels_per_cm)
    return Recorder(folder, header)
