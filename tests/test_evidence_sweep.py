"""Sweeps lose nothing: not to a kill, not to a worker's death, not to another sweep in the same folder."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

import pytest

from pscover import InvalidResult, InvalidSettings
from pscover.evidence.executors import cluster
from pscover.evidence.machine import this_machine
from pscover.evidence.sweep import Done, Store, run_sweep

sys.path.insert(0, str(Path(__file__).parent))
from dask_workers import two_workers
from squares import SQUARES, Number, Square, cases, square

PROGRAM = Path(__file__).with_name("squares.py")


def inline() -> AbstractContextManager[Executor]:
    return ThreadPoolExecutor(1)


def serial(folder: Path, seconds: float = 0.0) -> Store[Number, Square, float]:
    store = Store(folder, SQUARES)
    run_sweep(store, cases(seconds), inline)
    return store


def test_a_store_gives_back_what_was_kept(tmp_path: Path) -> None:
    serial(tmp_path)
    again = Store(tmp_path, SQUARES)
    assert [again.row(case) for case in cases()] == [square(case).row for case in cases()]
    assert again.cases == tuple(cases())
    assert again.machine(cases()[0]) == this_machine()
    timing = again.timing(cases()[0])
    assert timing is not None
    assert timing >= 0
    assert again.row(Number(value=99)) is None
    assert again.timing(Number(value=99)) is None
    assert again.machine(Number(value=99)) is None


def test_only_what_is_missing_runs_and_a_case_counts_once(tmp_path: Path) -> None:
    ran: list[int] = []

    def counted(case: Number) -> Done[Square, float]:
        ran.append(case.value)
        done: Done[Square, float] = square(case)
        return done

    seen: list[int] = []
    sweep = replace(SQUARES, run=counted)
    run_sweep(Store(tmp_path, sweep), [*cases()[:3], *cases()[:2]], inline)
    run_sweep(Store(tmp_path, sweep), cases()[:5], inline, lambda case, row: seen.append(case.value))
    assert ran == [case.value for case in cases()[:5]]
    assert sorted(seen) == ran


def test_the_order_of_the_files_is_that_of_the_cases(tmp_path: Path) -> None:
    store = Store(tmp_path / "a", SQUARES)
    run_sweep(store, cases()[::-1], inline)
    run_sweep(store, cases(), inline)
    serial(tmp_path / "b")
    assert (tmp_path / "a" / "results.jsonl").read_bytes() == (tmp_path / "b" / "results.jsonl").read_bytes()


def test_a_line_cut_off_by_a_kill_is_run_again(tmp_path: Path) -> None:
    serial(tmp_path)
    path = tmp_path / "results.jsonl"
    whole = path.read_bytes()
    path.write_bytes(whole[:-9])
    cut = Store(tmp_path, SQUARES)
    assert cut.cases == tuple(cases()[:-1])
    assert cut.timing(cases()[-1]) is None
    run_sweep(cut, cases(), inline)
    assert path.read_bytes() == whole


def test_a_case_that_raises_costs_no_other(tmp_path: Path) -> None:
    store = Store(tmp_path, SQUARES)
    with pytest.raises(ArithmeticError, match="13"):
        run_sweep(store, [Number(value=13), *cases()], inline)
    assert store.cases == tuple(cases())


def test_folders_of_others_are_refused(tmp_path: Path) -> None:
    serial(tmp_path / "squares")
    before = (tmp_path / "squares" / "sweep.json").read_bytes()
    with pytest.raises(InvalidSettings, match="expected the sweep 'cubes', got 'squares'"):
        Store(tmp_path / "squares", replace(SQUARES, name="cubes"))
    with pytest.raises(InvalidSettings, match="setting power to be 3 as in this run, got 2; use another folder"):
        Store(tmp_path / "squares", replace(SQUARES, settings={"power": 3, "limits": {"most": 10}}))
    assert (tmp_path / "squares" / "sweep.json").read_bytes() == before
    (tmp_path / "letters").mkdir()
    (tmp_path / "letters" / "dear.txt").write_text("x")
    with pytest.raises(InvalidSettings, match=r"new or empty folder .* got one with dear\.txt"):
        Store(tmp_path / "letters", SQUARES)
    assert [path.name for path in (tmp_path / "letters").iterdir()] == ["dear.txt"]


def test_damage_is_named_by_line(tmp_path: Path) -> None:
    serial(tmp_path)
    path = tmp_path / "results.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    for damage in (b"x\n", b'{"case": {"value": 1}}\n', b'{"case": {"value": "one"}, "row": {}}\n', b"[]\n", b"\xff\xfe\n"):
        path.write_bytes(b"".join([*lines[:2], damage, *lines[3:]]))
        with pytest.raises(InvalidResult, match=r"results\.jsonl, line 3: .*delete the line"):
            Store(tmp_path, SQUARES)
    (tmp_path / "sweep.json").write_bytes(b"{")
    with pytest.raises(InvalidResult, match=r"sweep\.json"):
        Store(tmp_path, SQUARES)


def test_what_json_cannot_hold_is_not_kept(tmp_path: Path) -> None:
    store = Store(tmp_path, SQUARES)
    row = Square(square=1, root=float("nan"))
    with pytest.raises(InvalidResult, match="after JSON"):
        store.save(Number(value=1), Done(row=row, timing=0.0), this_machine())
    assert store.cases == ()
    assert not (tmp_path / "results.jsonl").exists()


def test_killed_and_resumed_gives_the_same_bytes(tmp_path: Path) -> None:
    def command(folder: Path) -> list[str]:
        return [sys.executable, str(PROGRAM), str(folder), "0.05"]

    serial(tmp_path / "whole", 0.05)
    cut = tmp_path / "cut"
    process = subprocess.Popen(command(cut), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    results = cut / "results.jsonl"
    while process.poll() is None and not (results.exists() and results.read_bytes().count(b"\n") >= 2):
        time.sleep(0.005)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    kept = results.read_bytes().splitlines()
    assert 2 <= len(kept) < len(cases())
    subprocess.run(command(cut), check=True, capture_output=True)
    assert results.read_bytes() == (tmp_path / "whole" / "results.jsonl").read_bytes()
    assert set(kept) <= set(results.read_bytes().splitlines())


def test_a_cluster_that_loses_a_worker_gives_the_same_bytes(tmp_path: Path) -> None:
    store = Store(tmp_path / "cluster", SQUARES)
    with two_workers() as workers:

        def everything(alive: Callable[[], None]) -> None:
            def kept(case: Number, row: Square) -> None:
                workers.kill_one()
                alive()

            run_sweep(store, cases(0.05), lambda: cluster(workers.address), kept)

        workers.finish(everything)
    serial(tmp_path / "serial", 0.05)
    assert (tmp_path / "cluster" / "results.jsonl").read_bytes() == (tmp_path / "serial" / "results.jsonl").read_bytes()
