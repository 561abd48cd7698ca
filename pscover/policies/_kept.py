"""Planning anew with what is left of the last plan: its grasps are candidates again, and the search starts from them."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pscover.execution.sight import Sight
from pscover.grasping.partition import partition
from pscover.grasping.sampling import Grasps, Sampling
from pscover.instance import Instance
from pscover.planning import SHORTEST, Plan, best_effort, paper_gripper, plan
from pscover.policies._cycle import Cycle
from pscover.robot import Pose
from pscover.scene import Scene


@dataclass(frozen=True, slots=True, kw_only=True)
class WithKept(Sampling):
    """A draw to which given poses are added, as far as they still lie on a garment.

    Parameters
    ----------
    kept
        x, y and theta in pixels of the scene.
    """

    kept: tuple[tuple[float, float, float], ...] = ()

    def draw(self, scene: Scene, seed: int | np.random.Generator = 0) -> Grasps:
        """The kept poses first, then those drawn.

        Examples
        --------
        >>> scene = Scene.of([[1, 1, 0]])
        >>> WithKept(points=1, orientations=1, kept=((0, 0, 0.5), (2, 0, 0.0))).draw(scene).poses.round(1).tolist()
        [[0.0, 0.0, 0.5], [1.0, 0.0, -1.6]]
        """
        drawn = Sampling(points=self.points, orientations=self.orientations, reach=self.reach).draw(scene, seed)
        parts = partition(scene, self.reach).parts
        height, width = scene.shape
        poses: list[tuple[float, float, float]] = []
        part: list[int] = []
        for x, y, theta in self.kept:
            column, row = min(max(round(x), 0), width - 1), min(max(round(y), 0), height - 1)
            if parts[row, column] >= 0:
                poses.append((x, y, theta))
                part.append(int(parts[row, column]))
        return Grasps(
            poses=np.concatenate((np.array(poses, dtype=np.float64).reshape(-1, 3), drawn.poses)),
            part=np.concatenate((np.array(part, dtype=np.int32), drawn.part)),
        )


def plan_from(cycle: Cycle, sight: Sight, left: Sequence[Pose], seed: int) -> Plan:
    """A plan for what is seen now, its search started from grasps that are left of an earlier plan.

    The best plan known when the cycle's seconds are over is taken; if none meets every requirement, the one that comes
    closest.
    """
    began = clock.monotonic()
    seen = sight.seen
    own, _ = paper_gripper(seen.scene.pixels_per_cm, points=cycle.points, orientations=cycle.orientations)
    kept = tuple((*seen.grid.from_photo(pose.x, pose.y), pose.theta) for pose in left)
    return plan(
        seen,
        sampling=WithKept(points=own.points, orientations=own.orientations, reach=own.reach, kept=kept),
        predictor=cycle.predictor_for(sight),
        required=cycle.required,
        backend=cycle.backend,
        formulation=cycle.formulation,
        time=max(SHORTEST, cycle.seconds - (clock.monotonic() - began)),
        seed=seed,
        start=lambda instance: _start(instance, kept),
    )


def _start(instance: Instance, kept: Sequence[tuple[float, float, float]]) -> tuple[int, ...]:
    """The kept grasps that may be in one plan, if they meet the requirements; else the greedy start."""
    poses = instance.meta.poses
    assert poses is not None
    wanted: NDArray[np.float64] = np.array(kept, dtype=np.float64).reshape(-1, 3)
    chosen: list[int] = []
    for pose in wanted:
        same = np.flatnonzero((poses == pose).all(axis=1))
        if len(same) and len(instance.conflicts.broken_by([*chosen, int(same[0])])) == 0:
            chosen.append(int(same[0]))
    is_enough = bool((instance.coverage(chosen) >= instance.required).all())
    return tuple(sorted(chosen)) if is_enough else best_effort(instance)
