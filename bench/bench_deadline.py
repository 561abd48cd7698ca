"""Does a time limit hold? Every backend on instances that are known to make engines overrun.

    pytest bench/bench_deadline.py

The overrun is what `solve` took beyond T + 5 %; it should stay below 0.1 s.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import pytest

import pscover
from pscover import registry
from pscover.generate.psc import random_psc
from pscover.io import load_instance


@cache
def _instance(name: str, folder: Path) -> pscover.Instance:
    if name == "synthetic 100k":
        return random_psc(elements=2000, candidates=100_000, covers=20, required=0.95, seed=0)
    return load_instance(folder / f"{name}.txt")


@pytest.mark.parametrize("seconds", [1.0, 5.0])
@pytest.mark.parametrize("name", ["sts135", "rail507", "synthetic 100k"])
@pytest.mark.parametrize("backend", registry.names("backend"))
def bench_deadline(benchmark: Any, orlib: Path, row: Any, backend: str, name: str, seconds: float) -> None:
    if not benchmark.enabled:
        seconds = 0.2
    if registry.missing(registry.lookup("backend", backend)):
        pytest.skip(f"{backend} is not installed")
    instance = _instance(name, orlib)
    pscover.warm_up(backend)
    result = benchmark.pedantic(pscover.solve, (instance,), {"backend": backend, "time": seconds}, rounds=1)
    took = result.timing.total
    row(
        "deadline: seconds beyond T + 5 %",
        backend=backend,
        instance=name,
        T=seconds,
        took=took,
        overrun=max(0.0, took - 1.05 * seconds),
        status=result.status.value,
        objective=result.objective,
    )
