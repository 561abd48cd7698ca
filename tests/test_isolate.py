"""Engines in processes of their own: deadlines, death, noise, threads."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

import pscover
from pscover import EngineFailed, Instance, Refused, Result, Status, Stop, isolate

sys.path.insert(0, str(Path(__file__).parent))
from engines import Inline, Misbehaving

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


def test_a_slow_observer_holds_nothing_up_after_the_deadline() -> None:
    heard = 0

    def slow(progress: pscover.Progress) -> bool:
        nonlocal heard
        heard += 1
        time.sleep(1.5)
        return False

    many = Instance.of([[0.9] * 30])
    engine = Misbehaving(plans=tuple(tuple(range(k)) for k in range(30, 0, -1)), then="sleep")
    isolate.warm_up(engine)
    result = pscover.solve(many, backend=engine, time=2.5, observe=slow)
    assert (result.stop, result.objective) == (Stop.TIME, 1.0)
    assert heard <= 4


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
    assert result.chosen is not None
    assert result.chosen.tolist() == [2]


def test_an_engine_that_is_still_imported_at_the_deadline_is_kept_for_the_next_solve(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "slow_to_import.py").write_text("import time\ntime.sleep(3)\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(Misbehaving, "requires", ("slow_to_import",))
    isolate.shut_down()
    engine = Misbehaving(plans=((2,),), bound=1.0, status=Status.OPTIMAL)
    isolate.warm_up(engine)
    (worker,) = isolate._idle
    assert _solve(engine, seconds=1.5).status is Status.UNKNOWN
    assert isolate._idle == [worker]
    assert _solve(engine).status is Status.OPTIMAL


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_forked_child_leaves_the_parents_workers_alone() -> None:
    engine = Misbehaving(plans=((2,),))
    assert _solve(engine).objective == 1.0
    idle = list(isolate._idle)
    child = os.fork()
    if child == 0:
        good = not isolate._idle and _solve(engine).objective == 1.0
        isolate.shut_down()
        os._exit(0 if good else 1)
    assert os.waitpid(child, 0)[1] == 0
    assert isolate._idle == idle
    assert _solve(engine).objective == 1.0


def test_files_in_the_current_folder_are_not_taken_for_python_modules(tmp_path: Path) -> None:
    (tmp_path / "json.py").write_text("raise SystemExit\n")
    code = "import sys, pathlib, pscover\nsys.path.append(pathlib.Path('.'))\n"
    code += "print(pscover.solve(pscover.Instance.of([[1.0]])).objective)"
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, timeout=60, cwd=tmp_path, check=True
    )
    assert done.stdout == "1.0\n"


def test_a_machine_without_processes_is_an_error_of_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    isolate.shut_down()
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    with pytest.raises(EngineFailed, match="no process could be started for backend 'misbehaving'"):
        _solve(Misbehaving())


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


def test_large_models_are_isolated_under_a_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pscover.search.INLINE_LIMIT", 0)
    result = pscover.solve(INSTANCE, backend=Inline(then="sleep"), time=1.0)
    assert (result.status, result.stop) == (Status.UNKNOWN, Stop.TIME)
    assert result.timing.total < 30
