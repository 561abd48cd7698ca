"""Exact plans at the paper's sizes: `auto` against the paper's own set-up, SciPy's milp on pairwise rows, in CPU seconds.

    pytest bench/bench_exact.py

35 garments, apart or in seven overlapping groups of five, with the paper's settings (k = 5, l = 6, q = 0.7), ten seeds each.
Both sides get the same instance and one thread, and both times hold building the model and solving it, measured one after
the other in this process. A side that does not prove its plan within `LIMIT` seconds is marked; where that is SciPy, the
ratio is what is known of it, a lower bound. A third table goes from the label image to the proven plan.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest

from pscover import registry
from pscover.generate.garments import garments
from pscover.grasping.candidates import candidates
from pscover.instance import Instance
from pscover.result import Answer, Settings, Status
from pscover.scene import Scene

SEEDS = range(10)
GROUPS: dict[str, tuple[int, ...]] = {"disjoint": (), "overlapping": (5,) * 7}
LIMIT = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Side:
    """One way to solve an instance."""

    formulation: str
    engine: str

    def run(self, instance: Instance, limit: float) -> tuple[Answer, float]:
        """The engine's answer, and CPU seconds of this process to build and solve the model."""
        begin = time.process_time()
        model = registry.formulation(self.formulation).build(instance)
        answer = registry.backend(self.engine).solve(model, Settings(time=limit, threads=1), lambda _: False)
        return answer, time.process_time() - begin


OURS = Side(formulation="clique", engine="auto")
PAPER = Side(formulation="pairwise", engine="scipy")


@cache
def scene(kind: str, seed: int, count: int) -> Scene:
    """Garments on a table."""
    sizes = GROUPS[kind] if count == 35 else tuple(min(size, count) for size in GROUPS[kind][:1])
    return garments(count, seed=seed, groups=sizes)


def proven(answer: Answer) -> bool:
    """Whether nothing is open."""
    return answer.status in (Status.OPTIMAL, Status.INFEASIBLE)


def warm() -> None:
    """Load the kernels and run everything once, so that imports are on no side's account."""
    warming = pytest.importorskip("pscover.engine.warm").warming
    assert warming().wait(300.0)
    small = candidates(scene("disjoint", 0, 5), seed=0)
    for side in (OURS, PAPER):
        side.run(small, 10.0)


def text(seconds: float, answer: Answer) -> str:
    """CPU seconds, marked where the plan is not proven."""
    return f"{seconds:.3f}" if proven(answer) else f"> {seconds:.1f}"


@pytest.mark.parametrize("kind", GROUPS)
def bench_exact(benchmark: Any, row: Any, kind: str) -> None:
    warm()
    seeds, count, limit = (SEEDS, 35, LIMIT) if benchmark.enabled else (range(1), 8, 10.0)
    title = f"Proven plans, {kind}: CPU seconds"
    ratios: list[float] = []

    def all_seeds() -> None:
        for seed in seeds:
            instance = candidates(scene(kind, seed, count), seed=seed)
            ours, mine = OURS.run(instance, limit)
            paper, its = PAPER.run(instance, limit)
            if proven(ours) and proven(paper):
                assert size(ours) == size(paper)
            ratios.append(its / mine if proven(ours) else math.nan)
            row(
                title,
                seed=seed,
                candidates=instance.candidates,
                auto=text(mine, ours),
                milp=text(its, paper),
                grasps=size(ours),
                milp_grasps=size(paper),
                ratio=ratios[-1],
            )

    benchmark.pedantic(all_seeds, rounds=1)
    known = [ratio for ratio in ratios if ratio == ratio]
    mean = float(np.exp(np.mean(np.log(known)))) if known else math.nan
    row(title, seed="geometric mean", auto=f"{len(known)} of {len(ratios)} proven", ratio=mean)


def size(answer: Answer) -> int | str:
    """How many grasps a plan has."""
    return "none" if answer.chosen is None else len(answer.chosen)


def bench_label_image_to_proven_plan(benchmark: Any, row: Any) -> None:
    """Candidates, model, presolve, proof: all that lies between a label image and its plan."""
    warm()
    seeds, count = (SEEDS, 35) if benchmark.enabled else (range(1), 8)

    def all_seeds() -> None:
        for seed in seeds:
            labelled = scene("disjoint", seed, count)
            begin = time.process_time()
            instance = candidates(labelled, seed=seed)
            drawn = time.process_time() - begin
            answer, solved = OURS.run(instance, LIMIT)
            row("From label image to proven plan: CPU seconds", seed=seed, candidates=drawn, plan=text(solved, answer))

    benchmark.pedantic(all_seeds, rounds=1)
