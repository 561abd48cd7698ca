"""The comparison of two files of results finds what moved and lets noise pass."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

SCRIPT = Path(__file__).parent.parent / "bench" / "compare.py"
if not SCRIPT.exists():
    pytest.skip("bench/compare.py is not beside the tests", allow_module_level=True)


@pytest.fixture(scope="module")
def compare() -> ModuleType:
    spec = importlib.util.spec_from_file_location("bench_compare", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["bench_compare"] = module
    spec.loader.exec_module(module)
    return module


def run(instance: str, contestant: str, objective: float, at: float = 1.0, digest: str = "d") -> dict[str, Any]:
    trace = [(at, objective, 80.0)]
    fields = {"contestant": contestant, "limit": 10.0, "seed": 0, "digest": digest, "objective": objective, "trace": trace}
    return {"instance": instance, **fields}


def written(path: Path, ours: list[float], peers: list[float], at: float = 1.0, digest: str = "d") -> Path:
    runs = {}
    for k, (mine, other) in enumerate(zip(ours, peers, strict=True)):
        runs[f"{k} ours"] = run(f"i{k}", "auto", mine, at, digest)
        runs[f"{k} peer"] = run(f"i{k}", "highs", other)
    path.write_text(json.dumps({"runs": runs}))
    return path


def found(compare: ModuleType, old: Path, new: Path) -> dict[str, Any]:
    return {one.figure: one for one in compare.changes(compare.load(old), compare.load(new))}


def test_what_moved_is_told(compare: ModuleType, tmp_path: Path) -> None:
    old = written(tmp_path / "old.json", [100, 100, 100, 100], [100, 101, 102, 103])
    new = written(tmp_path / "new.json", [95, 95, 95, 95], [100, 101, 102, 103])
    plan = found(compare, old, new)["plan"]
    assert plan.moved
    assert str(plan).startswith("better")
    assert plan.new / plan.old == pytest.approx(0.95)
    assert str(found(compare, new, old)["plan"]).startswith("WORSE")


def test_noise_passes(compare: ModuleType, tmp_path: Path) -> None:
    old = written(tmp_path / "old.json", [100, 100, 100, 100], [100, 100, 100, 100])
    new = written(tmp_path / "new.json", [97, 103, 98, 102.5], [100, 100, 100, 100])
    assert not found(compare, old, new)["plan"].moved


def test_a_machine_that_is_twice_as_slow_for_all_moves_no_plan(compare: ModuleType, tmp_path: Path) -> None:
    old = written(tmp_path / "old.json", [100] * 4, [100] * 4, at=1.0)
    later = written(tmp_path / "late.json", [100] * 4, [100] * 4, at=4.0)
    figures = found(compare, old, later)
    assert not figures["plan"].moved
    assert figures["primal integral"].moved


def test_too_few_instances_say_nothing(compare: ModuleType, tmp_path: Path) -> None:
    old = written(tmp_path / "old.json", [100, 100], [100, 100])
    new = written(tmp_path / "new.json", [50, 50], [100, 100])
    assert not found(compare, old, new)["plan"].moved


def test_another_problem_of_the_same_name_is_refused(compare: ModuleType, tmp_path: Path) -> None:
    old = written(tmp_path / "old.json", [100] * 3, [100] * 3)
    new = written(tmp_path / "new.json", [100] * 3, [100] * 3, digest="e")
    with pytest.raises(compare.Different, match="i0"):
        list(compare.changes(compare.load(old), compare.load(new)))


def test_the_program_ends_with_one_where_something_got_worse(tmp_path: Path) -> None:
    old = written(tmp_path / "old.json", [95] * 4, [100, 101, 102, 103])
    new = written(tmp_path / "new.json", [100] * 4, [100, 101, 102, 103])
    done = subprocess.run([sys.executable, SCRIPT, old, new], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "WORSE  plan, auto 10 s / highs 10 s" in done.stdout
    again = subprocess.run([sys.executable, SCRIPT, old, old], capture_output=True, text=True, check=False)
    assert again.returncode == 0


def test_measures_of_a_trace() -> None:
    sys.path.append(str(SCRIPT.parents[1]))
    from bench.peers.measures import at, first_within, primal_integral

    trace = [(1.0, None, 5.0), (2.0, 20.0, 5.0), (6.0, 10.0, 8.0)]
    assert at(trace, 1.5) == (float("inf"), 5.0)
    assert at(trace, 9.0) == (10.0, 8.0)
    assert first_within(trace, 15.0) == 6.0
    # 1 for two seconds, 1/2 for four, 0 for four.
    assert primal_integral(trace, 10.0, 10.0) == pytest.approx(0.4)
