"""Plans over all poses against plans from samples: gap, time, and the ratio of grasps.

pytest bench/bench_all_poses.py

Seconds are CPU seconds of this process for weighing and pricing all poses and for a first plan (`ready`), and wall seconds
of the whole plan with its engine. PSCOVER_SECONDS sets the deadline of each plan, PSCOVER_SCENES the number of scenes of the
comparison with samples.
"""

from __future__ import annotations

import math
import os
import time
from typing import Any

import numpy as np
import pytest
from scipy import stats

from pscover.generate.garments import garments
from pscover.grasping.all_poses import all_poses
from pscover.grasping.diving import dive
from pscover.grasping.ellipse import Ellipse
from pscover.grasping.pricing import price
from pscover.grasping.sampling import Sampling
from pscover.planning import Plan, plan
from pscover.scene import Scene
from pscover.widening import whole

SECONDS = float(os.environ.get("PSCOVER_SECONDS", "5"))
SCENES = int(os.environ.get("PSCOVER_SCENES", "20"))
BACKEND = os.environ.get("PSCOVER_BACKEND", "auto")
LAYOUTS = ("apart", "piled")


def scene(count: int, seed: int, layout: str) -> Scene:
    return garments(count, seed, layout="piled" if layout == "piled" else "apart")


def seconds(benchmark: Any) -> float:
    """The deadline of a plan: short where nothing is measured."""
    return SECONDS if benchmark.enabled else 1.5


def over_all(labelled: Scene, orientations: int, time: float) -> Plan:
    return plan(labelled, candidates="all", sampling=Sampling(orientations=orientations), backend=BACKEND, time=time)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("orientations", [6, 12, 36])
@pytest.mark.parametrize("count", [10, 20, 35])
def bench_gap_and_time(benchmark: Any, row: Any, count: int, orientations: int, layout: str) -> None:
    if not benchmark.enabled and (count, orientations) != (10, 6):
        pytest.skip("one size is enough where nothing is measured")
    labelled, required = scene(count, 0, layout), np.full(count, 0.7)
    began = time.process_time()
    poses = all_poses(labelled, Sampling(orientations=orientations), Ellipse(), required)
    assert poses is not None
    weighed = time.process_time()
    prices = price(poses)
    assert prices is not None
    priced = time.process_time()
    first = dive(poses, prices)
    ready = time.process_time()
    found = benchmark.pedantic(over_all, (labelled, orientations, seconds(benchmark)), rounds=1)
    row(
        "All poses: gap and time",
        garments=count,
        layout=layout,
        orientations=orientations,
        poses=len(poses),
        weigh_cpu=weighed - began,
        price_cpu=priced - weighed,
        dive_cpu=ready - priced,
        ready_cpu=ready - began,
        first=math.nan if first is None else len(first),
        relaxed=whole(prices.bound),
        grasps=len(found.grasps),
        bound=found.bound,
        gap=len(found.grasps) - found.bound,
        over=found.scope.candidates,
        status=str(found.status),
        wall=found.seconds.candidates + found.seconds.solve,
    )
    assert found.bound <= len(found.grasps)


@pytest.mark.parametrize("layout", LAYOUTS)
def bench_fewer_grasps_than_sampled(benchmark: Any, row: Any, layout: str) -> None:
    """10 to 20 garments, 12 orientations against the paper's sampling with 6."""

    limit, scenes = seconds(benchmark), SCENES if benchmark.enabled else 2

    def pairs() -> list[tuple[Plan, Plan]]:
        found = []
        for seed in range(scenes):
            labelled = scene(10 + seed % 11, seed, layout)
            drawn = plan(labelled, backend=BACKEND, time=limit, seed=seed)
            found.append((drawn, over_all(labelled, 12, limit)))
        return found

    both = benchmark.pedantic(pairs, rounds=1)
    measured = np.array([len(wide.grasps) / len(drawn.grasps) for drawn, wide in both if not drawn.unmet and not wide.unmet])
    half = stats.t.ppf(0.975, len(measured) - 1) * measured.std(ddof=1) / math.sqrt(len(measured))
    row(
        "All poses: grasps as a part of those from samples",
        layout=layout,
        scenes=len(both),
        compared=len(measured),
        only_all_meets=sum(bool(drawn.unmet) and not wide.unmet for drawn, wide in both),
        only_sampled_meets=sum(bool(wide.unmet) and not drawn.unmet for drawn, wide in both),
        mean_gap=float(np.mean([len(wide.grasps) - wide.bound for _, wide in both if not wide.unmet])),
        mean_ratio=float(measured.mean()),
        low=float(measured.mean() - half),
        high=float(measured.mean() + half),
        best=float(measured.min()),
        worst=float(measured.max()),
    )
    assert (measured > 0).all()
