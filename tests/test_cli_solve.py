"""`pscover solve`, `pscover verify` and `pscover info`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from click.testing import Result as Shown

from pscover import Instance, Meta, Status
from pscover.cli.app import app
from pscover.cli.fail import Exit
from pscover.io import load_result, save_instance, save_result
from pscover.solve import solve


def run(*arguments: str | Path) -> Shown:
    return CliRunner(env={"COLUMNS": "80"}).invoke(app, [str(a) for a in arguments])


def document(shown: Shown) -> Any:
    """The one JSON document on standard output, without the numbers that JSON lacks."""

    def refuse(name: str) -> None:
        raise AssertionError(f"{name} is no JSON")

    return json.loads(shown.stdout, parse_constant=refuse)


@pytest.fixture
def small(tmp_path: Path) -> Path:
    path = tmp_path / "small.json"
    meta = Meta(name="small [bold]", elements=("sock", "shirt"), candidates=("left", "right", "both"))
    save_instance(Instance.of([[0.8, 0.0, 0.75], [0.0, 0.9, 0.75]], required=0.7, meta=meta), path)
    return path


@pytest.fixture
def hopeless(tmp_path: Path) -> Path:
    path = tmp_path / "hopeless.json"
    meta = Meta(elements=("lost scarf", "sock"))
    save_instance(Instance.of([[0.6, 0.6, 0.5], [0.9, 0.0, 0.0]], required=[0.85, 0.5], conflicts=[(0, 1)], meta=meta), path)
    return path


def test_a_table_for_a_person(small: Path) -> None:
    shown = run("solve", small, "-b", "greedy")
    assert shown.exit_code == Exit.VERIFIED
    assert "small [bold]: 2 elements, 3 candidates" in shown.stdout
    assert "objective  1\n" in shown.stdout
    assert "1 of 3 candidates: both" in shown.stdout
    assert "verified   yes" in shown.stdout
    assert "\x1b" not in shown.output
    assert max(map(len, shown.stdout.splitlines())) <= 80
    assert not any(line.endswith(" ") for line in shown.stdout.splitlines())
    assert shown.stderr == ""


def test_highs_proves_it(small: Path) -> None:
    shown = run("solve", small, "--json")
    assert shown.exit_code == Exit.VERIFIED
    content = document(shown)
    assert content["result"]["status"] == "optimal"
    assert content["result"]["chosen"] == [2]
    assert content["result"]["objective"] == content["result"]["bound"] == 1
    assert content["result"]["gap"] == 0
    assert content["verification"]["passed"] is True
    assert content["instance"]["digest"] == content["result"]["digest"]


def test_json_has_null_for_what_is_not_known(hopeless: Path) -> None:
    content = document(run("solve", hopeless, "-b", "greedy", "--json", "--time", "inf"))
    assert content["result"]["objective"] is None
    assert content["result"]["gap"] is None
    assert content["result"]["settings"]["time"] is None


def test_files_come_out_whole(small: Path, tmp_path: Path) -> None:
    output, trace = tmp_path / "result.json", tmp_path / "trace.jsonl"
    shown = run("solve", small, "-o", output, "--trace", trace)
    assert shown.exit_code == Exit.VERIFIED
    assert load_result(output).objective == 1
    steps = [json.loads(line) for line in trace.read_text().splitlines()]
    assert steps
    assert steps[-1]["objective"] == 1
    assert f"wrote the result to {output}" in shown.stderr
    assert "wrote" not in shown.stdout
    assert sorted(p.name for p in tmp_path.iterdir()) == ["result.json", "small.json", "trace.jsonl"]


def test_quiet_says_nothing_on_standard_error(small: Path, tmp_path: Path) -> None:
    shown = run("solve", small, "-o", tmp_path / "result.json", "--quiet", "-b", "greedy")
    assert shown.stderr == ""
    assert "objective" in shown.stdout


def test_a_start_is_used(small: Path, tmp_path: Path) -> None:
    first = tmp_path / "first.json"
    run("solve", small, "-b", "greedy", "-o", first)
    content = document(run("solve", small, "--start", first, "--json"))
    assert content["result"]["settings"]["start"] == [2]


def test_a_start_of_another_instance_is_noted(small: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.json"
    save_result(solve(Instance.of([[0.9]], required=0.5), backend="greedy"), other)
    shown = run("solve", small, "-b", "greedy", "--start", other)
    assert shown.exit_code == Exit.VERIFIED
    assert "of another instance" in shown.stderr


def test_what_a_start_of_a_larger_instance_names_beyond_this_one_is_left_out(small: Path, tmp_path: Path) -> None:
    larger = tmp_path / "larger.json"
    save_result(solve(Instance.of(np.eye(5) * 0.9, required=0.5), backend="greedy"), larger)
    content = document(run("solve", small, "-b", "greedy", "--start", larger, "--json"))
    assert content["result"]["settings"]["start"] == [0, 1, 2]


def test_a_start_without_a_plan_is_an_error(small: Path, hopeless: Path, tmp_path: Path) -> None:
    first = tmp_path / "first.json"
    assert run("solve", hopeless, "-o", first).exit_code == Exit.NO_PLAN
    if load_result(first).chosen is None:
        shown = run("solve", small, "--start", first)
        assert shown.exit_code == Exit.BAD_INPUT
        assert "a plan to start from" in shown.stderr


def test_parameters_reach_the_formulation(small: Path) -> None:
    content = document(run("solve", small, "-f", "budgeted", "--set", "budget=1", "--json"))
    assert content["result"]["formulation"] == "budgeted"
    assert json.loads(content["result"]["options"])["budget"] == 1


def test_infeasible_says_what_cannot_be_reached_and_why(hopeless: Path) -> None:
    shown = run("solve", hopeless)
    assert shown.exit_code == Exit.NO_PLAN
    assert "infeasible" in shown.stdout
    assert "lost scarf" in shown.stdout
    assert "0.85" in shown.stdout
    assert "0.8 " in shown.stdout
    assert "cliques that bind" in shown.stdout
    assert "elastic" in shown.stderr
    found = document(run("solve", hopeless, "--json"))["result"]["diagnosis"]["unreachable"]
    assert [(u["element"], round(u["reach"], 6), u["cliques"]) for u in found] == [(0, 0.8, [0])]


def test_infeasible_only_together_names_what_is_left_short(tmp_path: Path) -> None:
    path = tmp_path / "either.json"
    instance = Instance.of([[0.9, 0.0], [0.0, 0.9]], required=0.7, conflicts=[(0, 1)], meta=Meta(elements=("one", "two")))
    save_instance(instance, path)
    shown = run("solve", path)
    assert shown.exit_code == Exit.NO_PLAN
    assert "left short" in shown.stdout
    assert "on trust" in shown.stdout


def test_a_failed_check_is_no_verified_plan(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from dataclasses import replace

    def wrong(*given: object, **named: Any) -> Any:
        named.pop("observe")
        result = solve(*given, **named)  # type: ignore[arg-type]
        return replace(result, value=(0.5,))

    monkeypatch.setattr(sys.modules["pscover.solve"], "solve", wrong)
    shown = run("solve", small, "-b", "greedy")
    assert shown.exit_code == Exit.NO_PLAN
    assert "FAILED" in shown.stdout


@pytest.mark.parametrize(
    ("content", "word"),
    [(b"", "empty"), (b'{"schema": "pscover.instance/1", "elem', "line 1"), (b"\xff\xfe", ""), (b"[1, 2]", "expected")],
)
@pytest.mark.parametrize("command", ["solve", "info", "compare"])
def test_a_damaged_instance_is_one_line(tmp_path: Path, command: str, content: bytes, word: str) -> None:
    path = tmp_path / "damaged.json"
    path.write_bytes(content)
    shown = run(command, path)
    assert shown.exit_code == Exit.BAD_INPUT
    assert len(shown.stderr.splitlines()) == 1
    assert "damaged.json" in shown.stderr
    assert word in shown.stderr


@pytest.mark.parametrize("command", ["solve", "info", "compare"])
def test_a_missing_file_and_a_directory(tmp_path: Path, command: str) -> None:
    folder = tmp_path / "folder.json"
    folder.mkdir()
    for path, word in ((tmp_path / "none.json", "no such file"), (folder, "directory"), (tmp_path / "x.doc", ".json")):
        shown = run(command, path)
        assert shown.exit_code == Exit.BAD_INPUT
        assert word in shown.stderr


def test_an_unwritable_output_is_found_before_the_solve(
    small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*given: object, **named: object) -> None:
        raise AssertionError("solved, although the output cannot be written")

    monkeypatch.setattr(sys.modules["pscover.solve"], "solve", never)
    for option, path in (("-o", tmp_path / "none" / "r.json"), ("-o", tmp_path), ("-o", small), ("--trace", tmp_path / "t")):
        shown = run("solve", small, option, path)
        assert shown.exit_code == Exit.BAD_INPUT, shown.output
        assert len(shown.stderr.splitlines()) == 1


def test_a_full_disk_does_not_cost_the_plan(small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from pscover import PscoverError

    def full(*given: object) -> None:
        raise PscoverError("r.json: cannot be written: no space left")

    monkeypatch.setattr("pscover.io.save_result", full)
    shown = run("solve", small, "-b", "greedy", "-o", tmp_path / "r.json")
    assert shown.exit_code == Exit.BAD_INPUT
    assert "1 of 3 candidates: both" in shown.stdout
    assert "no space left" in shown.stderr


def test_verify_passes_what_solve_wrote(small: Path, tmp_path: Path) -> None:
    output = tmp_path / "result.json"
    run("solve", small, "-b", "greedy", "-o", output)
    shown = run("verify", small, output)
    assert shown.exit_code == Exit.VERIFIED
    assert "no check failed" in shown.stdout
    content = document(run("verify", small, output, "--json"))
    assert content["verification"]["passed"] is True
    assert {c["verdict"] for c in content["verification"]["checks"]} <= {"passed", "unchecked"}


def test_verify_finds_a_changed_number(small: Path, tmp_path: Path) -> None:
    output = tmp_path / "result.json"
    run("solve", small, "-b", "greedy", "-o", output)
    content = json.loads(output.read_text())
    content["coverage"][0] = 0.99
    output.write_text(json.dumps(content))
    shown = run("verify", small, output)
    assert shown.exit_code == Exit.NO_PLAN
    assert "VERIFICATION FAILED" in shown.stdout
    assert run("verify", small, output, "--json").exit_code == Exit.NO_PLAN


def test_verify_tells_another_instance(small: Path, hopeless: Path, tmp_path: Path) -> None:
    output = tmp_path / "result.json"
    run("solve", small, "-b", "greedy", "-o", output)
    assert run("verify", hopeless, output).exit_code == Exit.NO_PLAN


def test_verify_of_no_result_is_bad_input(small: Path) -> None:
    shown = run("verify", small, small)
    assert shown.exit_code == Exit.BAD_INPUT
    assert "pscover.result/1" in shown.stderr


def test_info_of_an_instance(hopeless: Path) -> None:
    shown = run("info", hopeless)
    assert shown.exit_code == 0
    assert "lost scarf" in shown.stdout
    content = document(run("info", hopeless, "--json"))
    assert (content["elements"], content["candidates"], content["cliques"]) == (2, 3, 1)
    assert content["density"] == pytest.approx(4 / 6)
    assert content["probability"] == {"lowest": 0.5, "highest": 0.9}
    assert content["required"] == {"lowest": 0.5, "highest": 0.85}
    assert content["components"] == 1
    assert [(far["name"], far["cliques"]) for far in content["out_of_reach"]] == [("lost scarf", [0])]
    assert content["digest"] in shown.stdout


def test_info_counts_components() -> None:
    from pscover.cli.info import components

    assert components(Instance.of(np.eye(3))) == 3
    assert components(Instance.of(np.eye(3), conflicts=[(0, 2)])) == 2
    assert components(Instance.of(np.zeros((0, 0)))) == 0


def test_info_of_an_instance_of_nothing(tmp_path: Path) -> None:
    path = tmp_path / "nothing.json"
    save_instance(Instance.of(np.zeros((0, 0))), path)
    assert run("info", path).exit_code == 0
    assert document(run("info", path, "--json"))["density"] is None
    assert document(run("solve", path, "--json"))["result"]["status"] == Status.OPTIMAL
