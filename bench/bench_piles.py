"""Dense garment piles: our `auto` against HiGHS, SCIP and CP-SAT, in CPU seconds.

    pytest bench/bench_piles.py

measures what is missing in `bench/results/piles.json` (24 instances; hours for all of them) and writes the table
`bench/results/piles.md`. For single contestants and instances: `python bench/peers/contest.py piles --help`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from bench.peers import families, pages
from bench.peers.contestants import absent
from bench.peers.families import Case
from bench.peers.measures import at, primal_integral
from bench.peers.runner import Contestant, measure
from bench.peers.store import RESULTS, Store, sweep
from pscover.generate.garments import garments
from pscover.grasping.candidates import candidates
from pscover.grasping.sampling import Sampling

OURS = [Contestant(engine="auto", limit=limit) for limit in pages.OURS]
PEERS = [Contestant(engine=name, limit=60.0) for name in pages.EXACT]


def tiny() -> Case:
    """A pile that every contestant plans in a fraction of a second."""
    scene = garments(8, seed=0, layout="piled")
    return Case("tiny", lambda: candidates(scene, sampling=Sampling(points=3), required=0.7))


@pytest.mark.parametrize("name", ["auto", *pages.EXACT])
def bench_piles(benchmark: Any, row: Any, tmp_path: Path, name: str) -> None:
    package = absent(name)
    if package is not None:
        pytest.skip(f"{package} is not installed")
    if benchmark.enabled:
        cases, store = families.piles(), Store(RESULTS / "piles.json")
        contestants = [one for one in (*OURS, *PEERS) if one.engine == name]
        benchmark.pedantic(sweep, (store, cases, contestants), rounds=1)
        pages.write("piles", RESULTS, [case.name for case in cases])
        return
    instance = tiny().get()
    run = benchmark.pedantic(measure, ("tiny", instance, Contestant(engine=name, limit=0.5)), rounds=1)
    assert run.objective is not None, run.status
    assert run.rejected == 0
    assert run.bound is None or run.bound <= run.objective
    assert at(run.trace, 1.0) == (run.objective, run.bound)
    assert 0 <= primal_integral(run.trace, run.objective, 0.5) < 1
    row("Piles, smoke", contestant=name, objective=run.objective, bound=run.bound, seconds=run.seconds)
