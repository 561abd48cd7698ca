"""From a scene to a plan: candidates, solve, and the grasps in the order in which a robot executes them."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import TYPE_CHECKING, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pscover import registry
from pscover.backend import Backend
from pscover.errors import InvalidSettings, Refused, UnknownName
from pscover.formulation import Formulation
from pscover.goal import Cover
from pscover.grasping.candidates import candidates as draw
from pscover.grasping.conflicts import Conflicts
from pscover.grasping.ellipse import Ellipse
from pscover.grasping.pool import Candidates, Scope
from pscover.grasping.predictor import Predictor
from pscover.grasping.sampling import Sampling
from pscover.grasps import Grasp, ordered
from pscover.instance import TOLERANCE, Instance
from pscover.perception.grid import PAPER_PIXELS_PER_CM
from pscover.perception.segmenter import Segmenter
from pscover.result import Observer, Progress, Result, Settings, Status, Stop, ignore
from pscover.scene import Scene
from pscover.seen import Seen
from pscover.solve import solve
from pscover.widening import DRAWING, grid_of, search, status_of, widen

if TYPE_CHECKING:
    from pscover.perception.depth import Depth
    from pscover.perception.perceive import Perception

FloatArray = NDArray[np.float64]
SHORTEST = 1e-3
"""Seconds given to a stage for which none are left, so that it still says what it holds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stages:
    """Wall seconds from scene to candidates, and from candidates to the checked plan; `Seen.stages` has those before."""

    candidates: float
    solve: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plan:
    """What to grasp, in which order, and how good that is.

    Parameters
    ----------
    seen
        What the plan clears, and where that was seen.
    instance
        The candidates that the plan was chosen from; their poses are in pixels of the scene.
    sampling
        How they were drawn.
    scope
        Over which poses the bound holds.
    axes
        The gripper's footprint: length along theta and width across it, in pixels of the scene.
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
        No plan from the poses of `scope` that meets every requirement has fewer grasps: infinite if it is proven
        that there is none, minus infinity if nothing is.
    seconds
        Where the time went.
    """

    seen: Seen
    instance: Instance
    sampling: Sampling
    scope: Scope
    axes: tuple[float, float]
    result: Result
    strict: Result | None
    grasps: tuple[Grasp, ...]
    coverage: FloatArray
    bound: float
    seconds: Stages

    @property
    def scene(self) -> Scene:
        """One label a pixel; for a photo, on the grid on which it was looked at."""
        return self.seen.scene

    @property
    def status(self) -> Status:
        """What is known of the problem over `scope`, every requirement to be met."""
        return status_of(self.strict or self.result, self.bound, self.scope)

    @property
    def expected_removed(self) -> float:
        """The expected number of garments that the plan removes."""
        return float(self.coverage.sum())

    @property
    def unmet(self) -> tuple[int, ...]:
        """The garments that the plan removes less surely than required."""
        return tuple(int(j) for j in np.flatnonzero(self.instance.required - self.coverage > TOLERANCE))


def plan(
    scene: Scene | Seen | Perception | str | PathLike[str] | ArrayLike,
    *,
    depth: Depth | str | PathLike[str] | ArrayLike | None = None,
    segmenter: str | Segmenter = "classical",
    sampling: Sampling | None = None,
    predictor: Predictor | None = None,
    candidates: Candidates = "sampled",
    conflicts: str | Conflicts | Sequence[str | Conflicts] = "partition",
    required: ArrayLike = 0.7,
    backend: str | Backend | None = None,
    formulation: str | Formulation = "clique",
    time: float = math.inf,
    gap: float = 0.0,
    threads: int = 1,
    seed: int = 0,
    start: Callable[[Instance], tuple[int, ...]] | None = None,
    observe: Observer = ignore,
) -> Plan:
    """Plan the grasps that clear a scene with the fewest trips.

    Where no plan that meets every requirement exists (a thin garment far from all others has one part only, so that one
    grasp must do) or is found, the plan comes as close as it can, and `Plan.unmet` names the garments that it leaves
    short. It is that of the "elastic" formulation, by HiGHS where the engine refuses it.

    Parameters
    ----------
    scene
        A photo (its path, or 8-bit RGB of shape (H, W, 3)), labels (the path of a PNG, or an array of shape (H, W)), the
        path of annotations, a scene, or what `pscover.perception.perceive.perceive` or `pscover.inputs.Look` made of a
        photo with a region of interest, a background, a scale.
    depth
        Of the photo that is given here, pixel by pixel: a path, an array, or a `pscover.perception.depth.Depth` with scale,
        camera and table. It is shown in pictures and reports; no plan depends on it.
    segmenter
        What finds the garments in a photo that is given here.
    sampling, predictor
        See `pscover.grasping.candidates.candidates`; in pixels of the scene. By default the paper's, at the scene's scale.
    candidates
        "sampled": those that are drawn (paper, section 4). "all": every garment pixel at each of the sampling's
        orientations, so that the bound holds over all of them; the sampling's points do not count then. If weighing all
        poses takes more than half of the time, candidates are drawn after all, and `Plan.scope` says so.
    conflicts, required
        See `pscover.grasping.candidates.candidates`. With all poses the conflicts are those of the partition.
    backend, formulation
        Engine and model, by name or made by hand. By default the engine is `auto`, or `highs` where Numba is not
        installed.
    time
        Seconds from the call, perception and candidates included, after which the best plan so far is returned.
        Perception and the drawing of candidates are not cut short.
    gap, threads, seed
        See `pscover.result.Settings`; the seed also is that of the draw.
    start
        The candidates that searches begin from where no earlier search has found better ones; by default `best_effort`.
    observe
        Called at each improvement; True asks to stop.

    Returns
    -------
    Plan

    Raises
    ------
    InvalidImage, InvalidInstance, InvalidSettings, UnknownName, MissingDependency, Refused, EngineFailed
        As the stages do. All poses are refused with other conflicts, with formulations of other goals, and where they are
        too many.

    Examples
    --------
    >>> labels = np.zeros((80, 160), dtype=int)
    >>> labels[20:60, 10:60], labels[20:60, 60:110] = 1, 2
    >>> found = plan(labels, required=0.6)
    >>> len(found.grasps), str(found.result.status), found.bound, found.unmet
    (1, 'optimal', 1.0, ())
    >>> [(removed.name, removed.probability > 0.6) for removed in found.grasps[0].removes]
    [('garment 1', True), ('garment 2', True)]

    Over all poses of the grid:

    >>> found = plan(labels, required=0.6, candidates="all")
    >>> found.scope.poses, found.instance.candidates, str(found.status), found.bound
    (24000, 1, 'optimal', 1.0)

    A photo with a red and a blue garment:

    >>> photo = np.full((80, 160, 3), 200, dtype=np.uint8)
    >>> photo[20:60, 10:60], photo[20:60, 90:140] = (180, 30, 30), (30, 30, 180)
    >>> len(plan(photo, required=0.6).grasps)
    2
    """
    settings = Settings(time=time, gap=gap, threads=threads, seed=seed)
    form = registry.formulation(formulation) if isinstance(formulation, str) else formulation
    chosen = registry.planning_backend() if backend is None else backend
    begin = clock.monotonic()
    seen = as_seen(scene, segmenter, depth)
    own_sampling, own_predictor = paper_gripper(seen.scene.pixels_per_cm)
    sampling, predictor, first = sampling or own_sampling, predictor or own_predictor, start or best_effort
    looked = clock.monotonic()
    if candidates not in get_args(Candidates):
        raise UnknownName.among("kind of candidates", str(candidates), get_args(Candidates))

    def left() -> float:
        return time - (clock.monotonic() - begin)

    def solved(
        instance: Instance,
        start: tuple[int, ...],
        form: Formulation | str,
        engine: Backend | str,
        most: float,
        watch: Observer,
    ) -> Result:
        stage = replace(settings, time=max(SHORTEST, min(most, left())), start=start)
        return solve(instance, backend=engine, formulation=form, settings=stage, observe=watch)

    def staged(instance: Instance, start: tuple[int, ...] | None, most: float, known: float, floor: float) -> Result:
        begun = first(instance) if start is None else start
        return solved(instance, begun, form, chosen, most, _between(known, floor, observe))

    drawing = clock.monotonic() + DRAWING * left()
    grid = None
    if candidates == "all":
        grid = grid_of(
            *(seen.scene, sampling, predictor, conflicts, required, form), over=lambda: clock.monotonic() > drawing
        )
    if grid is None:
        instance = draw(
            seen.scene, sampling=sampling, predictor=predictor, conflicts=conflicts, required=required, seed=seed
        )
    drawn = clock.monotonic()
    searched = search(instance, staged, left) if grid is None else widen(grid, staged, left)
    instance, result, strict = searched.instance, searched.result, None
    if not result.has_plan:
        strict, most = result, SHORTEST if result.stop is Stop.INTERRUPT else math.inf
        nearest = first(instance)
        try:
            result = solved(instance, nearest, "elastic", chosen, most, observe)
        except Refused:
            result = solved(instance, nearest, "elastic", "highs", most, observe)
    return Plan(
        seen=seen,
        instance=instance,
        sampling=sampling,
        scope=searched.scope,
        axes=predictor.axes,
        result=result,
        strict=strict,
        grasps=ordered(seen, instance, () if result.chosen is None else result.chosen.tolist()),
        coverage=np.zeros(instance.elements) if result.coverage is None else result.coverage,
        bound=searched.bound if isinstance(form.goal, Cover) else -math.inf,
        seconds=Stages(candidates=drawn - looked, solve=clock.monotonic() - drawn),
    )


def _between(known: float, floor: float, observe: Observer) -> Observer:
    """An observer of a search of which `known` is proven already, and that proves nothing above `floor`."""

    def watch(progress: Progress) -> bool:
        is_enough = math.isfinite(progress.objective) and progress.objective <= known
        return observe(replace(progress, bound=max(known, min(progress.bound, floor)))) or is_enough

    return watch


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


def paper_gripper(pixels_per_cm: float, *, points: int = 5, orientations: int = 6) -> tuple[Sampling, Ellipse]:
    """The paper's gripper, of 4.25 cm radius, at another scale than the paper's 4.7 pixels a centimetre.

    Examples
    --------
    >>> sampling, ellipse = paper_gripper(9.4)
    >>> sampling.reach, ellipse.axes, ellipse.half
    (40.0, (80.0, 24.0), 400.0)
    """
    scale = pixels_per_cm / PAPER_PIXELS_PER_CM
    sampling = Sampling(points=points, orientations=orientations, reach=20.0 * scale)
    return sampling, Ellipse(major=40.0 * scale, minor=12.0 * scale, half=100.0 * scale**2)


def as_seen(
    given: Scene | Seen | Perception | str | PathLike[str] | ArrayLike,
    segmenter: str | Segmenter = "classical",
    depth: Depth | str | PathLike[str] | ArrayLike | None = None,
) -> Seen:
    """What any input shows: see `plan`.

    Raises
    ------
    InvalidImage
        If there is no scene in it, or the depth does not fit it.
    InvalidSettings
        If depth comes with an input that has been looked at already.
    MissingDependency
        If it is a photo and the segmenter's packages are not installed.
    """
    if isinstance(given, Seen):
        _no_depth(depth)
        return given
    if isinstance(given, Scene):
        return _with_depth(Seen.whole(given), depth)
    # Reading photos and annotations takes imports that a plan from labels can do without.
    from pscover.inputs import Look, found
    from pscover.perception.perceive import Perception

    if isinstance(given, Perception):
        _no_depth(depth)
        return found(given, f"segmented by {given.provenance.segmenter}")
    if isinstance(given, str | PathLike):
        return Look(segmenter=segmenter).read(given, depth=depth)
    if _is_colour(given):
        return Look(segmenter=segmenter).photo(given, depth=depth)
    return _with_depth(Seen.whole(Scene.of(given)), depth)


def _with_depth(seen: Seen, depth: Depth | str | PathLike[str] | ArrayLike | None) -> Seen:
    if depth is None:
        return seen
    from pscover.perception.depth import Depth

    return replace(seen, heights=Depth.of(depth).heights(seen.grid))


def _no_depth(depth: object) -> None:
    if depth is not None:
        raise InvalidSettings(
            "depth: expected none with an input that has been looked at already; give it to `perceive` or `Look.photo`"
        )


def _is_colour(given: ArrayLike) -> bool:
    try:
        return np.ndim(given) == 3
    except ValueError:
        # Ragged lists: `Scene.of` says what is wrong with them.
        return False
