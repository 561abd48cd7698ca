"""From label image to instance: wall time by pytest-benchmark, and CPU seconds and peak memory in the table.

pytest bench/bench_candidates.py
"""

from __future__ import annotations

import time
import tracemalloc
from typing import Any

import pytest

from pscover.generate.garments import garments
from pscover.grasping.candidates import candidates
from pscover.scene import Scene

SMALL, LARGE = (282, 470), (2350, 2820)
SCENES = {
    "5 apart": (5, SMALL, "apart"),
    "35 apart": (35, SMALL, "apart"),
    "35 piled": (35, SMALL, "piled"),
    "100 piled": (100, SMALL, "piled"),
    "100 on a floor": (100, LARGE, "apart"),
    "1000 on a floor": (1000, LARGE, "apart"),
}


def scene(name: str) -> Scene:
    count, size, layout = SCENES[name]
    return garments(count, seed=0, size=size, layout="piled" if layout == "piled" else "apart")


@pytest.mark.parametrize("name", SCENES)
def bench_partition_rule(benchmark: Any, row: Any, name: str) -> None:
    measure(benchmark, row, name, "partition")


@pytest.mark.parametrize("rule", ["ellipse", "distance"])
def bench_geometric_rules(benchmark: Any, row: Any, rule: str) -> None:
    measure(benchmark, row, "35 apart", rule)


def measure(benchmark: Any, row: Any, name: str, rule: str) -> None:
    labelled = scene(name)
    tracemalloc.start()
    instance = candidates(labelled, conflicts=rule)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    begin = time.process_time()
    candidates(labelled, conflicts=rule)
    cpu = time.process_time() - begin
    benchmark.pedantic(candidates, (labelled,), {"conflicts": rule}, rounds=3)
    row(
        "Candidates: from label image to instance",
        scene=name,
        rule=rule,
        candidates=instance.candidates,
        probabilities=instance.probability.nnz,
        cliques=len(instance.conflicts),
        cpu_seconds=cpu,
        peak_mb=peak / 1e6,
    )
    assert instance.elements == labelled.garments
