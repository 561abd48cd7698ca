"""From an instance to a model inside an engine, nothing solved: what each path costs.

400 elements, 4 000 candidates, 80 000 probabilities, 200 disjoint cliques of 20. Run
`pytest bench/bench_build.py --benchmark-only`. OR-tools cannot share a process with highspy, so that CP-SAT is timed inside
a process of its own; its figure is printed with `-s` and kept in the benchmark's `extra_info`.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.sparse import coo_array

from pscover import registry
from pscover.instance import Instance

ELEMENTS, CANDIDATES, EACH, CLIQUE = 400, 4_000, 20, 20


def instance(seed: int = 0) -> Instance:
    """Each candidate covers 20 random elements; every candidate is in one clique of 20."""
    random = np.random.default_rng(seed)
    rows = np.concatenate([random.choice(ELEMENTS, EACH, replace=False) for _ in range(CANDIDATES)])
    columns = np.repeat(np.arange(CANDIDATES), EACH)
    p = coo_array((random.uniform(0.05, 0.4, len(rows)), (rows, columns)), shape=(ELEMENTS, CANDIDATES))
    return Instance.of(p, 0.7, 1.0, random.permutation(CANDIDATES).reshape(-1, CLIQUE))


def loader(name: str) -> Callable[[Instance], Any]:
    """Build the default formulation and load it into the engine."""
    load = import_module(f"pscover.backends.{name}").load
    formulation = registry.formulation("clique")
    return lambda given: load(formulation.build(given))


def test_formulation_alone(benchmark: Any) -> None:
    model = benchmark(registry.formulation("clique").build, instance())
    assert (model.rows, model.variables, model.nonzeros) == (600, 4_000, 84_000)


@pytest.mark.parametrize("name", ["highs", "scipy", "cvxpy", "pyomo", "scip"])
def test_build_and_load(benchmark: Any, name: str) -> None:
    absent = registry.missing(registry.lookup("backend", name))
    if absent:
        pytest.skip(f"needs {', '.join(absent)}")
    assert benchmark(loader(name), instance()) is not None


@pytest.mark.parametrize("name", ["cvxpy", "pyomo"])
def test_build_and_pass_on_to_highs(benchmark: Any, name: str) -> None:
    """A modelling layer has not reached the engine when its model is built: this includes compiling and handing over."""
    if registry.missing(registry.lookup("backend", name)):
        pytest.skip(f"needs {name}")
    build, given = loader(name), instance()

    def through() -> Any:
        built = build(given)
        if name == "cvxpy":
            return built.get_problem_data("HIGHS", ignore_dpp=True)[0]
        from pyomo.contrib.solver.solvers.highs import Highs

        engine = Highs()
        engine._active_config = engine.config()
        engine.set_instance(built)
        return engine

    assert benchmark(through) is not None


APART = """
import sys, json, time
sys.path[:] = json.loads(sys.argv[1])
from bench_build import instance, loader
given, build = instance(), loader("cpsat")
build(given)
spent = []
for _ in range(10):
    began = time.perf_counter()
    build(given)
    spent.append(time.perf_counter() - began)
print(json.dumps(spent))
"""


def test_build_and_load_cpsat(benchmark: Any) -> None:
    if registry.missing(registry.lookup("backend", "cpsat")):
        pytest.skip("needs ortools")
    path = json.dumps([*sys.path, str(Path(__file__).parent)])

    def apart() -> list[float]:
        done = subprocess.run([sys.executable, "-c", APART, path], capture_output=True, text=True, check=True)
        spent: list[float] = json.loads(done.stdout)
        return spent

    spent = benchmark.pedantic(apart, rounds=1)
    benchmark.extra_info["seconds"] = spent
    print(f"\ncpsat, timed inside its process: median {np.median(spent) * 1e3:.1f} ms, best {min(spent) * 1e3:.1f} ms")
    assert len(spent) == 10
