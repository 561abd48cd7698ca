"""The contestants: each loads an instance into its engine, then runs until it is done or its process is ended.

A contestant is a function `load(instance, seed, options, tell)` that returns a function without arguments, which solves.
`tell(bound, chosen)` reports a bound and, where it is new, a plan. What an engine costs to load is not on its clock, and
no engine is told a limit on wall time: the runner ends its process when its CPU seconds are spent.
"""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

Tell = Callable[[float, Any], None]
Solve = Callable[[], str]


def _model(instance: Any, options: dict[str, Any]) -> Any:
    from pscover import registry

    return registry.formulation(options.get("formulation", "clique")).build(instance)


def _picks(x: Any) -> Any:
    return np.flatnonzero(np.asarray(x) > 0.5)


def highs(instance: Any, seed: int, options: dict[str, Any], tell: Tell) -> Solve:
    """HiGHS' branch and bound at its own tolerances."""
    import highspy

    from pscover.backends.highs import load

    engine = load(_model(instance, options))
    wanted = {"threads": 1, "random_seed": seed, "mip_rel_gap": 0.0, **options.get("engine", {})}
    for name, value in wanted.items():
        assert engine.setOptionValue(name, value) == highspy.HighsStatus.kOk, name
    engine.cbMipImprovingSolution += lambda e: tell(e.data_out.mip_dual_bound, _picks(e.data_out.mip_solution))
    engine.cbMipInterrupt += lambda e: tell(e.data_out.mip_dual_bound, None)

    def solve() -> str:
        engine.run()
        found = engine.getSolution()
        tell(engine.getInfo().mip_dual_bound, _picks(found.col_value) if found.value_valid else None)
        return str(engine.modelStatusToString(engine.getModelStatus()))

    return solve


def scip(instance: Any, seed: int, options: dict[str, Any], tell: Tell) -> Solve:
    """SCIP's branch, cut and price at its own tolerances."""
    from pyscipopt import SCIP_EVENTTYPE as EVENT
    from pyscipopt import SCIP_PARAMEMPHASIS, SCIP_PARAMSETTING, Eventhdlr

    from pscover.backends.scip import load

    engine, x = load(_model(instance, options))
    engine.setParams({"randomization/randomseedshift": seed, **options.get("engine", {})})
    if "emphasis" in options:
        engine.setEmphasis(getattr(SCIP_PARAMEMPHASIS, options["emphasis"]))
    if "heuristics" in options:
        engine.setHeuristics(getattr(SCIP_PARAMSETTING, options["heuristics"]))
    bound = getattr(EVENT, "DUALBOUNDIMPROVED", EVENT.NODESOLVED)
    events = (EVENT.BESTSOLFOUND, bound, EVENT.NODESOLVED)

    class Watch(Eventhdlr):  # type: ignore[misc]
        def eventinit(self) -> None:
            for event in events:
                self.model.catchEvent(event, self)

        def eventexit(self) -> None:
            for event in events:
                self.model.dropEvent(event, self)

        def eventexec(self, event: Any) -> None:
            chosen = None
            if event.getType() == EVENT.BESTSOLFOUND:
                best = self.model.getBestSol()
                chosen = _picks([self.model.getSolVal(best, variable) for variable in x])
            tell(self.model.getDualbound(), chosen)

    engine.includeEventhdlr(Watch(), "trace", "reports incumbents and bounds")

    def solve() -> str:
        engine.optimize()
        best = engine.getBestSol() if engine.getNSols() else None
        tell(engine.getDualbound(), None if best is None else _picks([engine.getSolVal(best, variable) for variable in x]))
        return str(engine.getStatus())

    return solve


def cpsat(instance: Any, seed: int, options: dict[str, Any], tell: Tell) -> Solve:
    """OR-tools' CP-SAT, one worker."""
    from ortools.sat.python import cp_model

    from pscover.backends.cpsat import load

    built, unit = load(_model(instance, options))
    engine = cp_model.CpSolver()
    engine.parameters.num_workers = 1
    engine.parameters.random_seed = seed
    for name, value in options.get("engine", {}).items():
        setattr(engine.parameters, name, value)

    class Trace(cp_model.CpSolverSolutionCallback):  # type: ignore[misc]
        def on_solution_callback(self) -> None:
            tell(self.best_objective_bound / unit, _picks(list(self.response_proto.solution)))

    engine.best_bound_callback = lambda value: tell(value / unit, None)

    def solve() -> str:
        status = engine.status_name(engine.solve(built, Trace()))
        tell(engine.best_objective_bound / unit, None)
        return str(status)

    return solve


SIZE_LIMIT = 2000
"""Candidates or rows that Gurobi takes with the licence that comes with it."""


def gurobi(instance: Any, seed: int, options: dict[str, Any], tell: Tell) -> Solve:
    """Gurobi at its own tolerances, as far as its free licence goes."""
    import gurobipy

    model = _model(instance, options)
    if max(model.A.shape) > SIZE_LIMIT:
        return lambda: f"refused: more than the {SIZE_LIMIT} candidates or rows of the free licence"
    engine = gurobipy.Model(env=gurobipy.Env(params={"OutputFlag": 0, "Threads": 1, "Seed": seed, "MIPGap": 0.0}))
    x = engine.addMVar(model.variables, obj=model.c, vtype="B")
    for side, sense in ((model.lo, ">"), (model.hi, "<")):
        rows = np.flatnonzero(np.isfinite(side))
        if len(rows):
            engine.addMConstr(model.A[rows], x, sense, side[rows])
    event = gurobipy.GRB.Callback

    def hear(engine: Any, where: int) -> None:
        if where == event.MIPSOL:
            tell(engine.cbGet(event.MIPSOL_OBJBND), _picks(engine.cbGetSolution(x)))
        elif where == event.MIP:
            tell(engine.cbGet(event.MIP_OBJBND), None)

    def solve() -> str:
        engine.optimize(hear)
        tell(engine.ObjBound, _picks(x.X) if engine.SolCount else None)
        return "optimal" if engine.Status == gurobipy.GRB.OPTIMAL else f"status {engine.Status}"

    return solve


def setcoverpy(instance: Any, seed: int, options: dict[str, Any], tell: Tell) -> Solve:
    """SetCoverPy, Lagrangian relaxation and greedy: it stops by its own rule, and tells its plan at its end only."""
    setcover = import_module("SetCoverPy.setcover")
    np.random.seed(seed)
    problem = setcover.SetCover(instance.probability.toarray() > 0, instance.cost)

    def solve() -> str:
        with Path(os.devnull).open("w") as nowhere, contextlib.redirect_stdout(nowhere), np.errstate(all="ignore"):
            problem.SolveSCP()
        tell(-math.inf, np.flatnonzero(problem.s))
        return "returned"

    return solve


def cft(instance: Any, seed: int, options: dict[str, Any], tell: Tell) -> Solve:
    """The heuristic of Caprara, Fischetti and Toth by way of pycft: it tells its plan at its end only."""
    _bindings = import_module("pycft._bindings")
    p = instance.probability
    built = _bindings.Instance()
    for i in range(instance.candidates):
        built.add(p.indices[p.indptr[i] : p.indptr[i + 1]].tolist(), float(instance.cost[i]))
    built.rows.clear()
    built.prepare()
    environment = _bindings.Environment()
    environment.seed, environment.verbose = seed, 0
    environment.time_limit = options["limit"]

    def solve() -> str:
        result = _bindings.run(environment, built, _bindings.Solution())
        tell(result.dual.cost, np.array(result.sol.idxs))
        return "returned"

    return solve


def ortools_cover(instance: Any, seed: int, options: dict[str, Any], tell: Tell) -> Solve:
    """OR-tools' set-cover heuristics in a loop: greedy, steepest descent, then random removal, greedy and steepest again."""
    from ortools.set_cover.python import set_cover

    p = instance.probability
    model = set_cover.SetCoverModel()
    for i in range(instance.candidates):
        model.add_empty_subset(float(instance.cost[i]))
        for j in p.indices[p.indptr[i] : p.indptr[i + 1]].tolist():
            model.add_element_to_last_subset(j)

    def solve() -> str:
        invariant = set_cover.SetCoverInvariant(model)
        greedy, steepest = set_cover.GreedySolutionGenerator(invariant), set_cover.SteepestSearch(invariant)
        level = set_cover.consistency_level.FREE_AND_UNCOVERED
        best, kept = math.inf, []
        while True:
            greedy.next_solution()
            steepest.next_solution()
            if invariant.cost() < best:
                best, kept = invariant.cost(), list(invariant.export_solution_as_proto().subset)
                tell(-math.inf, np.array(kept))
            elif invariant.cost() > best:
                invariant.clear()
                for i in kept:
                    invariant.select(i, level)
            set_cover.clear_random_subsets(max(1, len(kept) // 10), invariant)

    return solve


def auto(instance: Any, seed: int, options: dict[str, Any], tell: Tell) -> Solve:
    """Our own default engine; building the model is on its clock."""
    from bench.peers.ours import prepare, run

    prepare()
    return lambda: run(instance, options["limit"], seed, tell, options)


LOAD: dict[str, Callable[[Any, int, dict[str, Any], Tell], Solve]] = {
    "highs": highs, "scip": scip, "cpsat": cpsat, "cft": cft, "ortools_cover": ortools_cover, "auto": auto,
    "gurobi": gurobi, "setcoverpy": setcoverpy,
}  # fmt: skip

PACKAGES = {
    "highs": ("highspy",), "scip": ("PySCIPOpt",), "cpsat": ("ortools",), "cft": ("pycft",),
    "ortools_cover": ("ortools",), "auto": ("pscover", "highspy", "numba"), "gurobi": ("gurobipy",),
    "setcoverpy": ("SetCoverPy",),
}  # fmt: skip


def absent(contestant: str) -> str | None:
    """The first package that a contestant needs and that is not installed, or None."""
    for package in PACKAGES[contestant]:
        try:
            version(package)
        except PackageNotFoundError:
            return package
    return None
