"""The paper's Table 2 and its third experiment: time against the number of garments, and against how they overlap.

    pytest bench/bench_table2.py

Scenes are painted (`pscover.generate.paint`) and segmented for real by `classical`. Three ways to the same plan are timed
side by side on the same instance, in wall seconds of one thread on a quiet machine, with engines warmed up: `scipy` on
`pairwise` (the paper's set-up), `highs` on `clique`, and `auto`. The paper's own numbers stand beside them as data; they
were measured on another machine.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import pytest

pytest.importorskip("cv2")
pytest.importorskip("numba")
pytest.importorskip("skimage")
from pscover import Instance, Scene, solve
from pscover.generate.garments import garments
from pscover.generate.paint import paint
from pscover.grasping.candidates import candidates
from pscover.perception.perceive import perceive

LIMIT = 60.0
"""Seconds an engine gets."""


@dataclass(frozen=True, slots=True)
class Published:
    """A column of the paper's Table 2."""

    segments: int
    segmentation: float
    milp: float


PAPER = {
    5: Published(4, 19.66, 1.43),
    10: Published(9, 18.86, 3.88),
    15: Published(14, 18.74, 6.73),
    20: Published(19, 18.73, 9.95),
    25: Published(24, 18.72, 13.42),
    30: Published(29, 18.81, 16.86),
    35: Published(35, 18.70, 22.27),
}
GROUPS = {0: (), 1: (3,), 2: (3,) * 2, 4: (3,) * 4, 6: (3,) * 6, 8: (3,) * 8, 10: (3,) * 10}
"""Overlapping groups among 35 garments, by their number."""
ENGINES = (("scipy", "pairwise"), ("highs", "clique"), ("auto", "clique"))


def solved(instance: Instance, backend: str, formulation: str) -> tuple[float, float, str]:
    """Seconds from the call to the checked plan, the objective, and what is known of it."""
    result = solve(instance, backend=backend, formulation=formulation, time=LIMIT)
    return result.timing.total, result.objective, str(result.status)


def measured(scene: Scene, row: Any, title: str, **first: Any) -> int:
    """One row: perceive, draw candidates, solve three ways. Returns the number of segments found."""
    photo = paint(scene)
    begin = time.process_time()
    seen = perceive(photo)
    perceived = time.process_time()
    instance = candidates(seen.scene)
    drawn = time.process_time()
    columns: dict[str, Any] = {}
    best = []
    for backend, formulation in ENGINES:
        spent, objective, status = solved(instance, backend, formulation)
        columns[f"{backend} {formulation} s"] = spent
        best.append((status, objective))
    proven = {objective for status, objective in best if status == "optimal"}
    assert len(proven) <= 1, best
    row(
        title,
        **first,
        segments=seen.scene.garments,
        segmentation_s=perceived - begin,
        candidates=instance.candidates,
        candidates_s=drawn - perceived,
        **columns,
        grasps=min(objective for _, objective in best),
        proven=bool(proven),
        ratio=columns["scipy pairwise s"] / columns["auto clique s"],
    )
    return seen.scene.garments


@pytest.fixture(scope="module", autouse=True)
def _warm() -> None:
    """Compile kernels and start processes before anything is timed."""
    small = candidates(garments(3, seed=0))
    for backend, formulation in ENGINES:
        solve(small, backend=backend, formulation=formulation)


@pytest.mark.parametrize("count", PAPER)
def bench_table2(benchmark: Any, row: Any, count: int) -> None:
    """Five garments more a row, none overlapping."""
    paper = PAPER[count]
    found = benchmark.pedantic(
        measured,
        (garments(count, seed=0), row, "Table 2: time against garments"),
        {
            "garments": count,
            "paper_segments": paper.segments,
            "paper_segmentation_s": paper.segmentation,
            "paper_milp_s": paper.milp,
        },
        rounds=1,
    )
    assert abs(found - count) <= max(1, count // 10)


@pytest.mark.parametrize("groups", GROUPS)
def bench_third_experiment(benchmark: Any, row: Any, groups: int) -> None:
    """35 garments, more and more of them in groups that touch."""
    scene = garments(35, seed=0, groups=GROUPS[groups])
    benchmark.pedantic(measured, (scene, row, "Third experiment: time against groups"), {"groups": groups}, rounds=1)
