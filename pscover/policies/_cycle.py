"""The cycle of the segment method, which several policies share (paper, section 5).

A plan is made once; its grasps are executed in order, those whose surroundings have changed since are left out, and
when none is left the next plan is made.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from pscover import registry
from pscover.errors import InvalidSettings
from pscover.execution.sight import Sight
from pscover.grasping.calibrated import Calibrated
from pscover.grasping.pool import Candidates
from pscover.grasping.predictor import Predictor
from pscover.grasps import Grasp
from pscover.instance import Instance
from pscover.planning import Plan, paper_gripper, plan
from pscover.policies._allowed import Allowed
from pscover.policy import Decision, Skip, trip
from pscover.robot import Pose

RGB = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """A grasp of a plan.

    Parameters
    ----------
    pose
        Where.
    distance
        To its basket, in pixels.
    area_cm2
        Sum of p_ij |M_j|: the area that it is expected to move.
    basket
        The basket for what it grasps; "" for the only one.
    """

    pose: Pose
    distance: float
    area_cm2: float
    basket: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pending:
    """What is left of a plan: the state of the policies that plan by segments.

    Parameters
    ----------
    targets
        In order of execution.
    reference
        The image that the plan was made from, shape (H, W, 3).
    """

    targets: tuple[Target, ...]
    reference: RGB


@dataclass(frozen=True, slots=True, kw_only=True)
class Cycle:
    """How to plan by segments, and when to give up a planned grasp.

    Parameters
    ----------
    candidates
        "sampled", as in the paper, or "all": every garment pixel, see `pscover.plan`.
    points, orientations, required
        k, l and q_j (paper, sections 2 and 4).
    backend, formulation
        Engine and model; by default the engine of `pscover.plan`. Which of several best plans `auto` finds depends on the
        machine's speed; `highs` and `greedy` find the same one again.
    seconds
        Deadline of a plan. A plan that the deadline cuts off depends on the machine's speed.
    square_cm
        Side of the square around a grasp in which images are compared; the paper says "small".
    threshold
        Mean squared difference of the colour channels in the square, in squared grey levels, from which the grasp is left
        out; the paper names no number.
    baskets
        Classes of garments that have a basket of their own: then no grasp mixes classes. Garments of other classes go to
        the basket "". By default there is one basket for all.
    mixing
        With several baskets: the highest probability that a grasp also removes a garment of another class.
    predictor
        Fitted to logged grasps by `pscover calibrate`; None for the paper's ellipse.

    Raises
    ------
    InvalidSettings
        If a number is outside its domain.
    UnknownName
        If there is no such backend or formulation.
    """

    candidates: Candidates = "sampled"
    points: int = 5
    orientations: int = 6
    required: float = 0.7
    backend: str = field(default_factory=registry.planning_backend)
    formulation: str = "clique"
    seconds: float = 20.0
    square_cm: float = 4.25
    threshold: float = 400.0
    baskets: tuple[str, ...] = ()
    mixing: float = 0.0
    predictor: Calibrated | None = None

    def __post_init__(self) -> None:
        kinds = get_args(Candidates)
        checks = (
            ("candidates", self.candidates in kinds, f"one of {', '.join(kinds)}", self.candidates),
            ("points", self.points >= 1, "a whole number of at least 1", self.points),
            ("orientations", self.orientations >= 1, "a whole number of at least 1", self.orientations),
            ("required", 0 <= self.required < 1, "a number in [0, 1)", self.required),
            ("seconds", self.seconds > 0, "a positive number", self.seconds),
            ("square_cm", 0 < self.square_cm <= 100, "a number above 0 and at most 100", self.square_cm),
            ("threshold", 0 <= self.threshold < math.inf, "a number of at least 0", self.threshold),
            ("mixing", 0 <= self.mixing <= 1, "a number from 0 to 1", self.mixing),
        )
        for name, good, expected, got in checks:
            if not good:
                raise InvalidSettings(f"{name}: expected {expected}, got {got!r}")
        # A wrong name would otherwise be found out by the first plan, in front of the robot.
        registry.lookup("backend", self.backend)
        registry.lookup("formulation", self.formulation)

    def left(self, sight: Sight, state: object | None) -> tuple[Pending | None, tuple[Skip, ...]]:
        """What is left of a plan under the picture of now, and which grasps are given up."""
        if not isinstance(state, Pending) or state.reference.shape != sight.frame.rgb.shape:
            return None, ()
        side = self.square_cm * sight.eyes.pixels_per_cm
        changes = [change(state.reference, sight.frame.rgb, target.pose, side) for target in state.targets]
        kept = tuple(t for t, changed in zip(state.targets, changes, strict=True) if changed <= self.threshold)
        skipped = tuple(
            Skip(pose=t.pose, change=changed)
            for t, changed in zip(state.targets, changes, strict=True)
            if changed > self.threshold
        )
        return (replace(state, targets=kept) if kept else None), skipped

    def fresh(self, sight: Sight, random: np.random.Generator) -> tuple[Pending, Plan]:
        """A new plan, its grasps by increasing distance to the basket."""
        sampling, _ = paper_gripper(sight.seen.scene.pixels_per_cm, points=self.points, orientations=self.orientations)
        made = plan(
            sight.seen,
            candidates=self.candidates,
            sampling=sampling,
            predictor=self.predictor_for(sight),
            required=self.required,
            backend=self.backend,
            formulation=self.formulation,
            time=self.seconds,
            seed=int(random.integers(2**31)),
        )
        return pending(self, sight, made.instance, made.grasps), made

    def predictor_for(self, sight: Sight) -> Predictor:
        """The predictor at the scene's scale, without the grasps that must not be made."""
        seen = sight.seen
        scale, groups = seen.scene.pixels_per_cm, None
        plain = self.predictor.at(scale, self._heights(sight)) if self.predictor else paper_gripper(scale)[1]
        if not sight.failed and not self.baskets:
            return plain
        if self.baskets:
            groups = np.array([basket_of(self, kind) for kind in sight.classes], dtype=np.intp)
        failed = [seen.grid.from_photo(x, y) for x, y in sight.failed]
        return Allowed(
            predictor=plain,
            failed=np.array(failed, dtype=np.float64).reshape(-1, 2),
            radius=sight.radius * seen.grid.factor,
            groups=groups,
            mixing=self.mixing,
        )

    def _heights(self, sight: Sight) -> NDArray[np.floating] | None:
        """For a predictor that asks for heights, on the scene's grid, where there is depth."""
        wants = self.predictor is not None and bool(self.predictor.weights)
        return sight.seen.grid.nearest(sight.heights) if wants and sight.frame.depth is not None else None


CYCLE = Cycle()


def next_grasp(cycle: Cycle, sight: Sight, state: object | None, random: np.random.Generator) -> Decision:
    """The next grasp of the segment method: of the plan under way, or of a new one."""
    left, skipped = cycle.left(sight, state)
    made = None
    if left is None:
        left, made = cycle.fresh(sight, random)
    if not left.targets:
        return Decision(actions=(), skipped=skipped, plan=made)
    target, rest = left.targets[0], left.targets[1:]
    return Decision(
        actions=trip(target.pose, basket=target.basket),
        state=replace(left, targets=rest),
        skipped=skipped,
        plan=made,
    )


def basket_of(cycle: Cycle, kind: str) -> int:
    """The number of the basket for a class; the last for classes without their own."""
    return cycle.baskets.index(kind) if kind in cycle.baskets else len(cycle.baskets)


def pending(cycle: Cycle, sight: Sight, instance: Instance, grasps: Sequence[Grasp]) -> Pending:
    """A plan's grasps as what is to be done."""
    areas = sight.seen.scene.areas() / sight.seen.scene.pixels_per_cm**2
    p, names = instance.probability, (*cycle.baskets, "")
    targets = []
    for grasp in grasps:
        span = slice(p.indptr[grasp.candidate], p.indptr[grasp.candidate + 1])
        basket = ""
        if cycle.baskets:
            basket = names[basket_of(cycle, sight.classes[grasp.removes[0].garment])]
        targets.append(
            Target(
                pose=Pose(x=grasp.x, y=grasp.y, theta=grasp.theta),
                distance=grasp.distance,
                area_cm2=float(p.data[span] @ areas[p.indices[span]]),
                basket=basket,
            )
        )
    return Pending(targets=tuple(targets), reference=sight.frame.rgb)


def change(before: RGB, now: RGB, pose: Pose, side: float) -> float:
    """Mean squared difference of two images in a square around a pose (paper, section 5), in squared grey levels.

    Parameters
    ----------
    before, now
        Shape (H, W, 3).
    pose
        The middle of the square, which is cut off at the images' edges.
    side
        Of the square, in pixels.

    Examples
    --------
    >>> before = np.zeros((20, 20, 3), dtype=np.uint8)
    >>> now = before.copy()
    >>> now[:, 10:] = 10
    >>> change(before, now, Pose(x=10, y=10), 3), change(before, now, Pose(x=4, y=4), 3)
    (66.66666666666667, 0.0)
    """
    height, width = before.shape[:2]
    half = max(0, round((side - 1) / 2))
    x, y = min(max(round(pose.x), 0), width - 1), min(max(round(pose.y), 0), height - 1)
    window = np.s_[max(0, y - half) : y + half + 1, max(0, x - half) : x + half + 1]
    difference = before[window].astype(np.float64) - now[window]
    return float((difference**2).mean())
