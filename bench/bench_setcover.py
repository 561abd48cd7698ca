"""Set cover of the OR-Library, plain and with probabilities: our `auto` against CFT, OR-tools and exact engines.

    pytest bench/bench_setcover.py

measures what is missing in `bench/results/covers.json` and `probabilistic.json` and writes their tables. For single
contestants and instances: `python bench/peers/contest.py covers --help`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from bench.peers import families, pages
from bench.peers.contestants import absent
from bench.peers.runner import Contestant, measure
from bench.peers.store import RESULTS, Store, sweep
from pscover.generate.psc import random_psc
from pscover.instance import Instance

LIMIT = {"covers": 60.0, "probabilistic": 60.0}
WHO = {"covers": ("auto", *pages.HEURISTICS, "highs"), "probabilistic": ("auto", *pages.EXACT)}


def _skip_without(name: str) -> None:
    package = absent(name)
    if package is not None:
        pytest.skip(f"{package} is not installed")


def tiny() -> Instance:
    """A plain cover of 20 elements by 60 sets."""
    drawn = random_psc(20, 60, covers=4, cheapest=1, dearest=9, low=1.0, high=1.0, required=0.5, seed=3)
    return Instance.of(drawn.probability, 0.5, drawn.cost)


@pytest.mark.parametrize("name", pages.HEURISTICS)
def bench_heuristics_run(benchmark: Any, row: Any, name: str) -> None:
    """A peer of its own kind finds a cover, and says so in time."""
    _skip_without(name)
    run = benchmark.pedantic(measure, ("tiny", tiny(), Contestant(engine=name, limit=0.5)), rounds=1)
    assert run.objective is not None, run.status
    assert run.rejected == 0
    row("Covers, smoke", contestant=name, objective=run.objective, bound=run.bound, seconds=run.seconds)


@pytest.mark.parametrize(("family", "name"), [(family, name) for family, names in WHO.items() for name in names])
def bench_setcover(benchmark: Any, orlib: Path, family: str, name: str) -> None:
    _skip_without(name)
    cases = families.covers() if family == "covers" else families.probabilistic()
    if not benchmark.enabled:
        assert len({case.name for case in cases}) == len(cases)
        assert (
            benchmark.pedantic(next(case for case in cases if case.name.startswith("scp41")).get, rounds=1).candidates
            == 1000
        )
        return
    store = Store(RESULTS / f"{family}.json")
    benchmark.pedantic(sweep, (store, cases, [Contestant(engine=name, limit=LIMIT[family])]), rounds=1)
    pages.write(family, RESULTS, [case.name for case in cases])
