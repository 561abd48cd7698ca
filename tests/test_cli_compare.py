"""`pscover compare`, `pscover backends` and `pscover formulations`."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from pscover import EngineFailed, Instance, MissingDependency, Refused, Stop, registry
from pscover.cli.app import app
from pscover.cli.compare import Cell, contradiction
from pscover.cli.fail import Exit
from pscover.gallery import card
from pscover.io import save_instance
from pscover.solve import solve


def run(*arguments: str | Path) -> Result:
    return CliRunner(env={"COLUMNS": "80"}).invoke(app, [str(a) for a in arguments])


@pytest.fixture
def small(tmp_path: Path) -> Path:
    path = tmp_path / "small.json"
    save_instance(Instance.of([[0.8, 0.0, 0.75], [0.0, 0.9, 0.75]], required=0.7), path)
    return path


@pytest.fixture
def certain(tmp_path: Path) -> Path:
    path = tmp_path / "certain.json"
    save_instance(Instance.of([[1.0, 0.0], [0.0, 1.0]], required=0.5), path)
    return path


def cells(shown: Result) -> list[dict[str, Any]]:
    content = json.loads(shown.stdout)
    return [cell for each in content["instances"] for cell in each["cells"]]


def test_a_table_over_backends_and_formulations(small: Path, certain: Path) -> None:
    shown = run("compare", small, certain, "-b", "highs,greedy", "-f", "clique,single_cover")
    assert shown.exit_code == Exit.VERIFIED
    lines = shown.stdout.splitlines()
    assert sum("greedy" in line for line in lines) == 4
    assert sum("highs" in line for line in lines) == 4
    assert max(map(len, lines)) <= 80
    assert "\x1b" not in shown.output


def test_the_same_as_json(small: Path) -> None:
    shown = run("compare", small, "-b", "highs,greedy", "--json")
    rows = cells(shown)
    assert [(row["backend"], row["objective"]) for row in rows] == [("highs", 1.0), ("greedy", 1.0)]
    assert rows[0]["status"] == "optimal"
    assert all(row["verified"] and row["seconds"] >= 0 and row["shortfall"] == 0 for row in rows)
    assert json.loads(shown.stdout)["interrupted"] is False


def test_all_backends_by_default(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pscover.registry.names", lambda kind: ("greedy", "highs"))
    assert [row["backend"] for row in cells(run("compare", small, "--json"))] == ["greedy", "highs"]


@pytest.mark.parametrize(
    ("error", "word"),
    [
        (Refused("backend 'greedy' refuses formulation 'clique': it may."), "refused"),
        (MissingDependency.for_extra("backend 'greedy'", ["grab"], "greed"), "missing"),
        (EngineFailed("the process of backend 'greedy' died"), "failed"),
    ],
    ids=["refused", "missing", "failed"],
)
def test_an_empty_cell_says_why(small: Path, monkeypatch: pytest.MonkeyPatch, error: Exception, word: str) -> None:
    def picky(instance: Instance, *, backend: str, **named: Any) -> Any:
        if backend == "greedy":
            raise error
        return solve(instance, backend=backend, **named)

    monkeypatch.setattr(sys.modules["pscover.solve"], "solve", picky)
    shown = run("compare", small, "-b", "greedy,highs")
    assert shown.exit_code == Exit.VERIFIED
    assert f"{word} [1]" in shown.stdout
    assert f"[1] {error}" in shown.stdout.replace("\n", " ")
    row, _ = cells(run("compare", small, "-b", "greedy,highs", "--json"))
    assert (row["status"], row["reason"]) == (word, str(error))
    assert run("compare", small, "-b", "greedy").exit_code == Exit.NO_PLAN


def test_an_instance_that_a_formulation_refuses(certain: Path) -> None:
    rows = cells(run("compare", certain, "-b", "greedy", "-f", "clique,elastic", "--json"))
    assert rows[0]["status"] in ("feasible", "optimal")
    assert rows[1]["status"] == "refused"
    assert "refuses" in rows[1]["reason"]


def test_ctrl_c_shows_what_is_known(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    solved: list[str] = []

    def interrupted(instance: Instance, *, backend: str, **named: Any) -> Any:
        if instance.candidates > 1:
            solved.append(backend)
        if backend == "greedy":
            raise KeyboardInterrupt
        return solve(instance, backend="greedy")

    monkeypatch.setattr(sys.modules["pscover.solve"], "solve", interrupted)
    shown = run("compare", small, small, "-b", "highs,greedy,scipy")
    assert "interrupted: this is what was known by then" in shown.stdout
    assert shown.stdout.count("not run") == 4
    assert solved == ["highs", "highs"]
    assert shown.exit_code == Exit.VERIFIED
    assert run("compare", small, "-b", "greedy,highs").exit_code == Exit.INTERRUPTED


def test_ctrl_c_within_an_engine_keeps_its_plan(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(instance: Instance, **named: Any) -> Any:
        return replace(solve(instance, backend="greedy"), stop=Stop.INTERRUPT)

    monkeypatch.setattr(sys.modules["pscover.solve"], "solve", interrupted)
    shown = run("compare", small, "-b", "highs,greedy", "--json")
    first, second = cells(shown)
    assert first["objective"] == 1
    assert second["status"] == "not run"
    assert json.loads(shown.stdout)["interrupted"] is True
    assert shown.exit_code == Exit.VERIFIED


def test_a_wrong_answer_is_called_wrong(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(instance: Instance, **named: Any) -> Any:
        return replace(solve(instance, backend="greedy"), value=(0.25,))

    monkeypatch.setattr(sys.modules["pscover.solve"], "solve", wrong)
    shown = run("compare", small, "-b", "greedy")
    assert shown.exit_code == Exit.NO_PLAN
    assert "WRONG [1]" in shown.stdout


def test_a_contradiction_is_seen() -> None:
    instance = Instance.of([[0.8, 0.0, 0.75], [0.0, 0.9, 0.75]], required=0.7)
    right = Cell(backend="greedy", formulation="clique", result=solve(instance, backend="greedy"))
    assert contradiction([right]) == ""
    assert right.result is not None
    proud = Cell(backend="highs", formulation="clique", result=replace(right.result, bound=2.0))
    assert "highs on clique claims that no plan is better than 2" in contradiction([right, proud])


def test_backends_are_listed() -> None:
    shown = run("backends")
    assert shown.exit_code == 0
    rows = json.loads(run("backends", "--json").stdout)["backends"]
    assert [row["name"] for row in rows] == list(registry.names("backend"))
    for row in rows:
        assert row["name"] in shown.stdout
        assert row["what"]
    assert next(row for row in rows if row["name"] == "highs")["exact"] is True
    assert next(row for row in rows if row["name"] == "greedy")["exact"] is False


def test_a_missing_backend_shows_its_pip_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pscover.registry.missing", lambda found: ("cvxpy",) if found.name == "cvxpy" else ())
    shown = run("backends")
    assert 'pip install "pscover[cvxpy]"' in shown.stdout
    assert shown.stdout.count("pip install") == 1


def test_formulations_are_listed_and_shown() -> None:
    shown = run("formulations")
    assert shown.exit_code == 0
    rows = json.loads(run("formulations", "--json").stdout)["formulations"]
    assert [row["name"] for row in rows] == list(registry.names("formulation"))
    assert {row["relation"] for row in rows} <= {"exact", "relaxation", "restriction"}
    assert next(row for row in rows if row["name"] == "clique")["relation"] == "exact"
    assert next(row for row in rows if row["name"] == "budgeted")["parameters"][0]["name"] == "budget"
    for row in rows:
        assert run("formulations", "show", row["name"]).stdout.strip() == card(row["name"]).strip()
