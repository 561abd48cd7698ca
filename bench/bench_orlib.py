"""OR-Library set cover by HiGHS: sets 4 and 5 to proven optimality, and four hard ones for twenty seconds.

pytest bench/bench_orlib.py
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import pytest

import pscover
from pscover.io import load_instance

EASY = [f"scp{group}{k}" for group in (4, 5) for k in range(1, 11)]
HARD = ["rail507", "scpnre1", "scpclr10", "sts135"]


def best_known(folder: Path, name: str) -> float:
    """The best known value of INDEX.tsv."""
    with (folder / "INDEX.tsv").open() as file:
        return float(next(line["best_known"] for line in csv.DictReader(file, delimiter="\t") if line["name"] == name))


@pytest.mark.parametrize("name", EASY)
def bench_proven_optimal(benchmark: Any, orlib: Path, row: Any, name: str) -> None:
    instance = load_instance(orlib / f"{name}.txt")
    result = benchmark.pedantic(pscover.solve, (instance,), {"backend": "highs", "time": 60}, rounds=1)
    known = best_known(orlib, name)
    row(
        "OR-Library sets 4 and 5: highs",
        instance=name,
        status=result.status.value,
        objective=result.objective,
        known=known,
        seconds=result.timing.total,
    )
    assert result.status is pscover.Status.OPTIMAL
    assert result.objective == known


@pytest.mark.parametrize("name", HARD)
def bench_twenty_seconds(benchmark: Any, orlib: Path, row: Any, name: str) -> None:
    instance = load_instance(orlib / f"{name}.txt")
    seconds = 20.0 if benchmark.enabled else 1.0
    result = benchmark.pedantic(pscover.solve, (instance,), {"backend": "highs", "time": seconds}, rounds=1)
    row(
        "OR-Library hard: highs for 20 s",
        instance=name,
        status=result.status.value,
        objective=result.objective,
        bound=result.bound,
        gap=result.gap,
        known=best_known(orlib, name),
        seconds=result.timing.total,
    )
