"""The pipeline: claims are weakened by evidence, tolerances are cut off, objectives are taken in order."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pscover
from pscover import Instance, InvalidInstance, InvalidSettings, Settings, Status, Stop, UnknownName

sys.path.insert(0, str(Path(__file__).parent))
from engines import Inline

INSTANCE = Instance.of([[0.8, 0.0, 0.75], [0.0, 0.9, 0.75]], required=0.7)


def test_a_claim_of_optimality_needs_a_bound() -> None:
    claims = Inline(plans=((0, 1),), status=Status.OPTIMAL, bound=1.0)
    assert pscover.solve(INSTANCE, backend=claims).status is Status.FEASIBLE
    honest = Inline(plans=((2,),), status=Status.OPTIMAL, bound=0.2)
    assert pscover.solve(INSTANCE, backend=honest).bound == 1.0
    assert pscover.solve(INSTANCE, backend=honest).status is Status.FEASIBLE
    assert pscover.solve(INSTANCE, backend=Inline(plans=((2,),), status=Status.OPTIMAL, bound=1.0)).status is Status.OPTIMAL


def test_a_plan_that_misses_a_requirement_is_no_plan() -> None:
    result = pscover.solve(INSTANCE, backend=Inline(plans=((0,),), status=Status.OPTIMAL, bound=1.0))
    assert not result.has_plan


def test_a_plan_that_breaks_a_conflict_is_no_plan() -> None:
    bound = Instance.of(INSTANCE.probability, INSTANCE.required, conflicts=[(0, 1)])
    assert pscover.solve(bound, backend=Inline(plans=((0, 1),))).status is Status.UNKNOWN


def test_a_claim_of_infeasibility_is_refuted_by_a_plan() -> None:
    result = pscover.solve(INSTANCE, backend=Inline(status=Status.INFEASIBLE), start=[2])
    assert result.status is Status.FEASIBLE


@pytest.mark.parametrize("formulation", ["clique", "pairwise"])
def test_a_shortfall_within_the_engines_tolerance_is_cut_off(formulation: str) -> None:
    required = 1 - 0.2 * 0.25 + 3e-9
    instance = Instance.of([[0.8, 0.75, 0.9]], required=required, cost=[1, 1, 3])
    result = pscover.solve(instance, formulation=formulation)
    assert result.status is Status.OPTIMAL
    assert result.shortfall is not None
    assert result.shortfall.max() <= 1e-9
    assert result.objective == 4.0


def test_margin_buys_strict_feasibility() -> None:
    instance = Instance.of([[0.7, 0.75]], required=0.7, cost=[1, 2])
    assert pscover.solve(instance).objective == 1
    assert pscover.solve(instance, margin=0.01).objective == 2


def test_what_is_proven_with_a_margin_is_not_proven_without() -> None:
    instance = Instance.of([[0.7, 0.75]], required=0.7, cost=[1, 2], conflicts=[(0, 1)])
    reachable = pscover.solve(instance, margin=0.2)
    assert (reachable.status, reachable.bound) == (Status.UNKNOWN, -np.inf)
    started = pscover.solve(instance, margin=0.01, start=[0])
    assert (started.status, started.objective, started.bound) == (Status.FEASIBLE, 1.0, -np.inf)


def test_a_bound_that_a_plan_refutes_is_none() -> None:
    for claim in (Status.OPTIMAL, Status.INFEASIBLE):
        result = pscover.solve(INSTANCE, backend=Inline(plans=((0, 1),), status=claim, bound=2.0), start=[2])
        assert (result.status, result.objective, result.bound) == (Status.FEASIBLE, 1.0, -np.inf)
        assert all(step.bound <= step.objective for step in result.trace)


@pytest.mark.parametrize("backend", ["highs", "greedy", "scipy"])
def test_tiny_costs_count(backend: str) -> None:
    random = np.random.default_rng(0)
    p = random.uniform(0.3, 0.9, (10, 20)) * (random.random((10, 20)) < 0.4)
    usual = Instance.of(p, required=0.6, cost=random.uniform(1, 3, 20))
    tiny = Instance.of(p, required=0.6, cost=usual.cost * 1e-9)
    best = pscover.solve(usual, backend=backend)
    found = pscover.solve(tiny, backend=backend, start=list(range(20)))
    assert found.objective <= best.objective * 1e-9 * (1 + 1e-9)
    assert found.bound == pytest.approx(best.bound * 1e-9, rel=1e-6)
    assert found.status is best.status


def test_explaining_infeasibility_keeps_the_deadline() -> None:
    random = np.random.default_rng(1)
    pairs = [(i, j) for i in range(400) for j in range(i) if random.random() < 0.1]
    instance = Instance.of(random.uniform(0.001, 0.003, (1, 400)), required=0.9, conflicts=pairs)
    result = pscover.solve(instance, backend="greedy", time=3.0)
    assert result.status is Status.INFEASIBLE
    assert result.diagnosis is not None
    (found,) = result.diagnosis.unreachable
    assert found.reach < found.ceiling < 0.9


def test_infeasibility_is_explained() -> None:
    alone = pscover.solve(Instance.of([[0.6, 0.6, 0.5]], required=0.85, conflicts=[(0, 1)]))
    assert alone.status is Status.INFEASIBLE
    assert alone.diagnosis is not None
    (found,) = alone.diagnosis.unreachable
    assert (found.element, found.cliques, round(found.reach, 9)) == (0, (0,), 0.8)
    together = pscover.solve(Instance.of([[0.8, 0], [0, 0.8]], conflicts=[(0, 1)]))
    assert together.status is Status.INFEASIBLE
    assert together.diagnosis is not None
    assert together.diagnosis.unreachable == ()
    assert [u.cliques for u in together.diagnosis.unmet] == [(0,)]


def test_a_restriction_proves_nothing_but_its_plans() -> None:
    instance = Instance.of([[0.5, 0.5, 0.9]], required=0.7, cost=[1, 1, 5])
    result = pscover.solve(instance, formulation="single_cover")
    assert (result.status, result.objective, result.bound) == (Status.FEASIBLE, 5.0, -np.inf)
    hopeless = Instance.of([[0.5, 0.5]], required=0.7)
    assert pscover.solve(hopeless, formulation="single_cover").status is Status.UNKNOWN


def test_empty_instances_have_the_empty_plan() -> None:
    for shape in ((0, 0), (0, 4)):
        result = pscover.solve(Instance.of(np.zeros(shape)))
        assert result.status is Status.OPTIMAL
        assert result.chosen is not None
        assert len(result.chosen) == 0
    assert pscover.solve(Instance.of(np.zeros((2, 0)))).status is Status.INFEASIBLE
    assert pscover.solve(Instance.of(np.zeros((2, 3)), required=0.0)).objective == 0


def test_settings_are_checked() -> None:
    for bad in ({"time": 0}, {"time": float("nan")}, {"gap": -1}, {"threads": 0}, {"seed": -1}, {"margin": 1.0}):
        with pytest.raises(InvalidSettings, match=next(iter(bad))):
            pscover.solve(INSTANCE, **bad)
    with pytest.raises(InvalidSettings, match="start"):
        pscover.solve(INSTANCE, start=[3])
    untyped: tuple[dict[str, Any], ...] = (
        {"time": "1"},
        {"gap": None},
        {"threads": 1.5},
        {"seed": "0"},
        {"margin": []},
        {"start": 5},
        {"start": "02"},
    )
    for wrong in untyped:
        with pytest.raises(InvalidSettings, match=f"^{next(iter(wrong))}.*expected"):
            pscover.solve(INSTANCE, **wrong)
    given = Settings(time=np.float32(2), seed=np.int64(3), start=np.array([0, 1]))  # type: ignore[arg-type]
    assert given == Settings(time=2.0, seed=3, start=(0, 1))
    with pytest.raises(UnknownName, match="did you mean 'threads'"):
        pscover.solve(INSTANCE, thread=2)
    with pytest.raises(UnknownName, match="did you mean 'highs'"):
        pscover.solve(INSTANCE, backend="higs")
    with pytest.raises(UnknownName, match="did you mean 'clique'"):
        pscover.solve(INSTANCE, formulation="cliques")
    assert pscover.solve(INSTANCE, settings=Settings(seed=3), time=5).settings == Settings(seed=3, time=5)


def test_arguments_of_another_kind_are_named() -> None:
    with pytest.raises(InvalidInstance, match=r"instance: expected an Instance .*got list"):
        pscover.solve([[0.8]])  # type: ignore[arg-type]
    mistakes: list[dict[str, Any]] = [{"backend": Inline}, {"formulation": 3}, {"settings": 5}, {"observe": None}]
    for wrong in mistakes:
        with pytest.raises(InvalidSettings, match=f"^{next(iter(wrong))}: expected"):
            pscover.solve(INSTANCE, **wrong)


def test_solving_from_a_thread_that_is_not_the_main_one() -> None:
    found: list[float] = []
    thread = threading.Thread(target=lambda: found.append(pscover.solve(INSTANCE).objective))
    thread.start()
    thread.join()
    assert found == [1.0]


def test_an_inline_engine_gives_way_to_ctrl_c(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*args: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Inline, "solve", interrupted)
    result = pscover.solve(INSTANCE, backend=Inline(), start=[0, 1])
    assert (result.stop, result.objective) == (Stop.INTERRUPT, 2.0)


def test_ctrl_c_ends_a_solve_with_the_best_plan(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import json, os, signal, sys, threading\n"
        f"sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
        "import pscover\nfrom engines import Misbehaving\n"
        "instance = pscover.Instance.of([[0.8, 0.0, 0.75], [0.0, 0.9, 0.75]])\n"
        "engine = Misbehaving(plans=((0, 1),), then='ignore everything')\n"
        "def interrupt(progress):\n"
        "    threading.Timer(0.1, lambda: os.kill(os.getpid(), signal.SIGINT)).start()\n"
        "    return False\n"
        "result = pscover.solve(instance, backend=engine, observe=interrupt)\n"
        "print(json.dumps([result.status.value, result.stop.value, result.objective, result.timing.total]))\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=60, check=True)
    status, stop, objective, total = json.loads(done.stdout)
    assert (status, stop, objective) == ("feasible", "interrupted", 2.0)
    assert total < 20
    assert done.stderr == ""
