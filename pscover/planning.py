"""From a scene to a plan: candidates, solve, and the grasps in the order in which a robot executes them."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pscover import registry
from pscover.backend import Backend
from pscover.errors import Refused
from pscover.formulation import Formulation
from pscover.goal import Cover
from pscover.grasping.candidates import ELLIPSE, SAMPLING, candidates
from pscover.grasping.conflicts import Conflicts
from pscover.grasping.predictor import Predictor
from pscover.grasping.sampling import Sampling
from pscover.instance import TOLERANCE, Instance
from pscover.result import Observer, Result, Settings, Stop, ignore
from pscover.scene import Scene
from pscover.solve import solve

FloatArray = NDArray[np.float64]
SHORTEST = 1e-3
"""Seconds given to a stage for which none are left, so that it still says what it holds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Removal:
    """What a grasp does to one garment.

    Parameters
    ----------
    garment
        Its index in the scene.
    name
        What it is called.
    probability
        p_ij, that the grasp removes it.
    """

    garment: int
    name: str
    probability: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Grasp:
    """One grasp of a plan.

    Parameters
    ----------
    candidate
        Its index in the instance.
    x, y
        Where, in pixels.
    theta
        Orientation of the jaw's length in radians, from the x axis towards the y axis.
    distance
        To the basket, in pixels.
    removes
        What it will probably remove, the most probable first.
    """

    candidate: int
    x: float
    y: float
    theta: float
    distance: float
    removes: tuple[Removal, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Stages:
    """Wall seconds from scene to candidates, and from candidates to the checked plan."""

    candidates: float
    solve: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plan:
    """What to grasp, in which order, and how good that is.

    Parameters
    ----------
    scene
        What the plan clears.
    instance
        All candidates that were drawn.
    sampling
        How they were drawn.
    axes
        The gripper's footprint: length along theta and width across it, in pixels.
    result
        Of the solve that gave the plan, with status and bound.
    strict
        Of the solve in which every requirement had to be met, if it gave no plan: `result` is then that of the
        "elastic" formulation, which comes as close to the requirements as it can. Else None.
    grasps
        By increasing distance to the basket (paper, section 5).
    coverage
        The probability that each garment is removed, shape (garments,).
    bound
        No plan from these candidates that meets every requirement has fewer grasps: infinite if it is proven
        that there is none, minus infinity if nothing is.
    seconds
        Where the time went.
    """

    scene: Scene
    instance: Instance
    sampling: Sampling
    axes: tuple[float, float]
    result: Result
    strict: Result | None
    grasps: tuple[Grasp, ...]
    coverage: FloatArray
    bound: float
    seconds: Stages

    @property
    def expected_removed(self) -> float:
        """The expected number of garments that the plan removes."""
        return float(self.coverage.sum())

    @property
    def unmet(self) -> tuple[int, ...]:
        """The garments that the plan removes less surely than required."""
        return tuple(int(j) for j in np.flatnonzero(self.instance.required - self.coverage > TOLERANCE))


def plan(
    scene: Scene | str | PathLike[str] | ArrayLike,
    *,
    sampling: Sampling = SAMPLING,
    predictor: Predictor = ELLIPSE,
    conflicts: str | Conflicts | Sequence[str | Conflicts] = "partition",
    required: ArrayLike = 0.7,
    backend: str | Backend = "highs",
    formulation: str | Formulation = "clique",
    time: float = math.inf,
    gap: float = 0.0,
    threads: int = 1,
    seed: int = 0,
    observe: Observer = ignore,
) -> Plan:
    """Plan the grasps that clear a scene with the fewest trips.

    Where no plan that meets every requirement exists (a thin garment far from all others has one part only, so that one
    grasp must do) or is found, the plan comes as close as it can, and `Plan.unmet` names the garments that it leaves
    short. It is that of the "elastic" formulation, by HiGHS where `backend` refuses it.

    Parameters
    ----------
    scene
        A scene, the path of a label PNG, or an array of labels.
    sampling, predictor, conflicts, required
        See `pscover.grasping.candidates.candidates`.
    backend, formulation
        Engine and model, by name or made by hand.
    time
        Seconds from the call, candidates included, after which the best plan so far is returned.
    gap, threads, seed
        See `pscover.result.Settings`; the seed also is that of the draw.
    observe
        Called at each improvement; True asks to stop.

    Returns
    -------
    Plan

    Raises
    ------
    InvalidImage, InvalidInstance, InvalidSettings, UnknownName, MissingDependency, Refused, EngineFailed
        As the stages do.

    Examples
    --------
    >>> labels = np.zeros((80, 160), dtype=int)
    >>> labels[20:60, 10:60], labels[20:60, 60:110] = 1, 2
    >>> found = plan(labels, required=0.6)
    >>> len(found.grasps), str(found.result.status), found.bound, found.unmet
    (1, 'optimal', 1.0, ())
    >>> [(removed.name, removed.probability > 0.6) for removed in found.grasps[0].removes]
    [('garment 1', True), ('garment 2', True)]
    """
    settings = Settings(time=time, gap=gap, threads=threads, seed=seed)
    form = registry.formulation(formulation) if isinstance(formulation, str) else formulation
    begin = clock.monotonic()
    scene = as_scene(scene)
    instance = candidates(scene, sampling=sampling, predictor=predictor, conflicts=conflicts, required=required, seed=seed)
    drawn = clock.monotonic()

    start = best_effort(instance)

    def solved(form: Formulation | str, engine: Backend | str, most: float = math.inf) -> Result:
        left = max(SHORTEST, min(most, time - (clock.monotonic() - begin)))
        stage = replace(settings, time=left, start=start)
        return solve(instance, backend=engine, formulation=form, settings=stage, observe=observe)

    result, strict = solved(form, backend), None
    if not result.has_plan:
        strict, most = result, SHORTEST if result.stop is Stop.INTERRUPT else math.inf
        try:
            result = solved("elastic", backend, most)
        except Refused:
            result = solved("elastic", "highs", most)
    bounding = strict or result
    return Plan(
        scene=scene,
        instance=instance,
        sampling=sampling,
        axes=predictor.axes,
        result=result,
        strict=strict,
        grasps=ordered(scene, instance, () if result.chosen is None else result.chosen.tolist()),
        coverage=np.zeros(instance.elements) if result.coverage is None else result.coverage,
        bound=bounding.bound if isinstance(form.goal, Cover) else -math.inf,
        seconds=Stages(candidates=drawn - begin, solve=clock.monotonic() - drawn),
    )


def best_effort(instance: Instance) -> tuple[int, ...]:
    """Candidates free of conflicts that greedily bring the coverage towards the requirements, whether these are met or not.

    Each step takes the candidate that adds most for its cost, an element counting up to its requirement (in log units).

    Examples
    --------
    >>> best_effort(Instance.of([[0.6, 0.5, 0.0], [0.0, 0.0, 0.2]], required=0.7, conflicts=[(0, 1)]))
    (0, 2)
    """
    weights = instance.truncated_weights()
    owner = np.repeat(np.arange(instance.candidates), np.diff(weights.indptr))
    membership = instance.conflicts.matrix(instance.candidates).tocsc()
    left = np.ones(instance.elements)
    allowed = np.ones(instance.candidates, dtype=np.bool_)
    chosen: list[int] = []
    while allowed.any():
        gained = np.minimum(weights.data, left[weights.indices])
        gain = np.bincount(owner, weights=gained, minlength=instance.candidates) * allowed / instance.cost
        best = int(gain.argmax())
        if gain[best] <= TOLERANCE:
            break
        chosen.append(best)
        allowed[best] = False
        for clique in membership.indices[membership.indptr[best] : membership.indptr[best + 1]]:
            allowed[instance.conflicts[int(clique)]] = False
        span = slice(weights.indptr[best], weights.indptr[best + 1])
        left[weights.indices[span]] = np.maximum(0.0, left[weights.indices[span]] - weights.data[span])
    return tuple(sorted(chosen))


def as_scene(given: Scene | str | PathLike[str] | ArrayLike) -> Scene:
    """The scene itself, or that of a label PNG or of a label array.

    Raises
    ------
    InvalidImage
        If there is no scene in it.
    """
    if isinstance(given, Scene):
        return given
    if isinstance(given, str | PathLike):
        return Scene.read(given)
    return Scene.of(given)


def ordered(scene: Scene, instance: Instance, chosen: Sequence[int]) -> tuple[Grasp, ...]:
    """The chosen candidates as grasps, by increasing distance to the basket; equally far ones by their index."""
    grasps = [_grasp(scene, instance, i) for i in sorted(chosen)]
    return tuple(sorted(grasps, key=lambda grasp: grasp.distance))


def _grasp(scene: Scene, instance: Instance, candidate: int) -> Grasp:
    p: Any = instance.probability
    span = slice(p.indptr[candidate], p.indptr[candidate + 1])
    removes = [
        Removal(garment=int(j), name=instance.meta.element(int(j)), probability=float(probability))
        for j, probability in zip(p.indices[span], p.data[span], strict=True)
    ]
    poses = instance.meta.poses
    assert poses is not None
    x, y, theta = (float(value) for value in poses[candidate])
    return Grasp(
        candidate=candidate,
        x=x,
        y=y,
        theta=theta,
        distance=math.hypot(x - scene.basket[0], y - scene.basket[1]),
        removes=tuple(sorted(removes, key=lambda removal: -removal.probability)),
    )
