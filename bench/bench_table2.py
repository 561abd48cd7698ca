"""The paper's Table 2 and its third experiment: time against the number of garments, and against how they overlap.

    pytest bench/bench_table2.py

One scene a row, measured as `pscover bench table2` and `pscover bench groups` do; those keep what they measured, and give
intervals over seeds. CPU seconds of one thread; the paper's own stand beside them as data, from another machine.
"""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("cv2")
pytest.importorskip("numba")
pytest.importorskip("skimage")
from pscover.evidence.growth import FULL, Case, Growth
from pscover.evidence.table2 import PAPER, Published

LIMIT = 20.0
GROUPS = (1, 2, 4, 6, 8, 10, 12)
SMALL = 3
"""Garments where only the way is tried."""


def measured(case: Case, row: Any, title: str, **first: Any) -> int:
    """One row; returns the number of segments found."""
    done = Growth(limit=LIMIT)(case)
    runs = done.timing.runs
    proven = {run.objective for run in runs if run.status == "optimal"}
    assert len(proven) <= 1, runs
    row(
        title,
        **first,
        segments=done.row.segments,
        segmentation_s=done.timing.segmentation,
        candidates=done.row.candidates,
        candidates_s=done.timing.candidates,
        **{run.engine: f"{'> ' if run.is_cut_off else ''}{run.seconds:.3f}" for run in runs},
        grasps=next(iter(proven), ""),
    )
    return done.row.segments


@pytest.mark.parametrize("count", PAPER)
def bench_table2(benchmark: Any, row: Any, count: int) -> None:
    """Five garments more a row, none overlapping."""
    if not benchmark.enabled and count != min(PAPER):
        pytest.skip("one size shows that it works")
    garments = count if benchmark.enabled else SMALL
    paper: Published = PAPER[count]
    found = benchmark.pedantic(
        measured,
        (Case(garments=garments, seed=0), row, "Table 2: time against garments"),
        {
            "garments": garments,
            "paper_segments": paper.segments,
            "paper_segmentation_s": paper.segmentation,
            "paper_milp_s": paper.milp,
        },
        rounds=1,
    )
    assert abs(found - garments) <= max(1, garments // 10)


@pytest.mark.parametrize("groups", GROUPS)
def bench_third_experiment(benchmark: Any, row: Any, groups: int) -> None:
    """35 garments, more and more of them in groups that touch."""
    if not benchmark.enabled and groups != min(GROUPS):
        pytest.skip("one number of groups shows that it works")
    case = Case(garments=FULL if benchmark.enabled else SMALL, groups=groups, seed=0)
    benchmark.pedantic(measured, (case, row, "Third experiment: time against groups"), {"groups": groups}, rounds=1)
