"""Engines in processes of their own: deadlines, death, noise, threads."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import pscover
from pscover import EngineFailed, Instance, Refused, Result, Status, Stop, isolate

sys.path.insert(0, str(Path(__file__).parent))
from engines import Misbehaving

INSTANCE = Instance.of([[0.8, 0.0, 0.75], [0.0, 0.9, 0.75]], required=0.7)


def _solve(engine: Misbehaving, seconds: float = 20.0) -> Result:
    return pscover.solve(INSTANCE, backend=engine, time=seconds)


def test_an_engine_that_ignores_its_limit_is_ended_with_its_best_plan() -> None:
    result = _solve(Misbehaving(plans=((0, 1), (2,)), bound=1.0, then="sleep"), seconds=5.0)
    assert result.stop is Stop.TIME
    assert result.status is Status.FEASIBLE
    assert result.chosen is not None
    assert result.chosen.tolist() == [2]
    assert result.bound == 1.0
    assert [p.objective for p in result.trace] == [2.0, 1.0]
    assert result.timing.total < 30


def test_without_a_plan_the_deadline_leaves_it_unknown() -> None:
    result = _solve(Misbehaving(then="sleep"), seconds=0.2)
    assert (result.status, result.stop, result.chosen) == (Status.UNKNOWN, Stop.TIME, None)


def test_the_start_is_returned_when_the_engine_has_nothing() -> None:
    result = pscover.solve(INSTANCE, backend=Misbehaving(then="sleep"), time=0.2, start=[0, 1])
    assert result.status is Status.FEASIBLE
    assert result.objective == 2.0


@pytest.mark.parametrize(
    ("then", "message"),
    [("die", r"died \(exit code 7\)"), ("raise", "failed: RuntimeError: wires crossed")],
)
def test_a_broken_engine_is_an_error_without_a_plan_and_a_message_with_one(then: str, message: str) -> None:
    with pytest.raises(EngineFailed, match=message):
        _solve(Misbehaving(then=then))
    result = _solve(Misbehaving(plans=((2,),), then=then))
    assert result.status is Status.FEASIBLE
    assert message.split(r"\(")[0].split(":")[0] in result.message


def test_refusals_arrive_whole() -> None:
    with pytest.raises(Refused, match="backend 'misbehaving' refuses formulation 'clique': it never takes anything"):
        _solve(Misbehaving(then="refuse"))
    with pytest.raises(Refused, match="on second thoughts, no"):
        _solve(Misbehaving(then="refuse late"))


def test_engines_may_print() -> None:
    assert _solve(Misbehaving(plans=((2,),), then="chatter")).objective == 1.0


@pytest.mark.parametrize("then", ["sleep", "ignore everything"])
def test_the_observer_stops_the_engine_even_if_it_will_not_listen(then: str) -> None:
    seen = []

    def stop_at_first(progress: pscover.Progress) -> bool:
        seen.append(progress.objective)
        return True

    engine = Misbehaving(plans=((0, 1), (2,)), pause=0.05, then=then)
    result = pscover.solve(INSTANCE, backend=engine, time=30, observe=stop_at_first)
    assert result.stop is Stop.OBSERVER
    assert result.has_plan
    assert seen[0] == 2.0
    assert result.timing.total < 10


def test_an_observer_that_raises_is_heard() -> None:
    def broken(progress: pscover.Progress) -> bool:
        raise ZeroDivisionError("in the observer")

    with pytest.raises(ZeroDivisionError, match="in the observer"):
        pscover.solve(INSTANCE, backend=Misbehaving(plans=((2,),), then="sleep"), observe=broken)


def test_threads_solve_at_once_each_with_its_own_answer() -> None:
    answers: dict[int, list[int]] = {}

    def work(k: int) -> None:
        plan = [(0, 1), (2,), (0, 2), (1, 2)][k % 4]
        for _ in range(5):
            result = _solve(Misbehaving(plans=(plan,)))
            assert result.chosen is not None
            answers[k] = result.chosen.tolist()

    threads = [threading.Thread(target=work, args=(k,)) for k in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert answers == {k: list([(0, 1), (2,), (0, 2), (1, 2)][k % 4]) for k in range(6)}


def test_a_worker_that_was_overtaken_while_starting_serves_the_next_solve() -> None:
    isolate.shut_down()
    assert _solve(Misbehaving(plans=((2,),)), seconds=0.001).status is Status.UNKNOWN
    result = _solve(Misbehaving(plans=((2,),), bound=1.0, status=Status.OPTIMAL))
    assert result.status is Status.OPTIMAL
    assert np.array_equal(result.chosen, [2])


def test_an_engine_from_a_script_says_what_to_do(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    body = Path(__file__).with_name("engines.py").read_text()
    script.write_text(
        body + "\nimport pscover\n"
        "instance = pscover.Instance.of([[0.8]])\n"
        "try:\n    pscover.solve(instance, backend=Misbehaving())\n"
        "except pscover.EngineFailed as error:\n    print(error)\n"
        "print(pscover.solve(instance, backend=Inline(plans=((0,),))).objective)\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=60, check=True)
    assert "must be importable: define it in a module of its own, or set isolated = False" in done.stdout
    assert done.stdout.endswith("1.0\n")
    assert done.stderr == ""
