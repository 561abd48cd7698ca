"""Results in files: what is read equals what was written, and nothing wrong is read."""

from __future__ import annotations

import json
import math
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pscover import Instance, InvalidResult, Progress, PscoverError, Result, Settings, Status, Stop, solve
from pscover.infeasibility import Diagnosis, Unmet, Unreachable
from pscover.io import load_result, save_result
from pscover.io.result import decode, encode
from pscover.result import Timing

FULL = Result(
    status=Status.FEASIBLE,
    stop=Stop.TIME,
    chosen=np.array([0, 2], dtype=np.int32),
    value=(2.5, 0.1 + 0.2),
    bound=1.25,
    coverage=np.array([0.1 + 0.7, 1.0]),
    shortfall=np.array([0.0, 5e-324]),
    backend="highs",
    formulation="clique",
    options='{"budget": Infinity}',
    settings=Settings(time=3.5, gap=0.01, threads=2, seed=7, margin=1e-9, start=(2, 0)),
    digest="0123456789abcdef" * 4,
    versions=(("pscover", "0.1.0"), ("numpy", "2")),
    timing=Timing(build=0.1, engine=0.2, check=0.3, total=0.6),
    trace=(
        Progress(seconds=0.1, objective=math.inf, bound=-math.inf),
        Progress(seconds=0.2, objective=2.5, bound=1.25, chosen=np.array([0, 2], dtype=np.int32)),
    ),
    message='a "word" – ünïcode\n',
)
INFEASIBLE = replace(
    FULL,
    status=Status.INFEASIBLE,
    stop=Stop.FINISHED,
    chosen=None,
    value=(),
    bound=math.inf,
    coverage=None,
    shortfall=None,
    settings=Settings(),
    trace=(Progress(seconds=0.0, objective=math.inf, bound=math.inf),),
    diagnosis=Diagnosis(
        unreachable=(Unreachable(element=3, required=0.9, reach=0.8, ceiling=0.85, cliques=(0, 4)),),
        unmet=(Unmet(element=1, required=0.7, coverage=0.5, cliques=()),),
    ),
)
UNBOUNDED = replace(FULL, status=Status.UNKNOWN, bound=-math.inf, trace=(), versions=(), message="")


def as_value(thing: Any) -> Any:
    """Arrays as (type, list), so that results can be compared."""
    if isinstance(thing, np.ndarray):
        return str(thing.dtype), thing.flags.writeable, thing.tolist()
    if isinstance(thing, Result | Progress):
        return type(thing).__name__, [as_value(getattr(thing, field.name)) for field in fields(thing)]
    return [as_value(part) for part in thing] if isinstance(thing, tuple) else thing


def frozen(result: Result) -> Result:
    for array in (result.chosen, result.coverage, result.shortfall, *(step.chosen for step in result.trace)):
        if array is not None:
            array.setflags(write=False)
    return result


@pytest.mark.parametrize("result", [FULL, INFEASIBLE, UNBOUNDED], ids=["full", "infeasible", "unbounded"])
def test_round_trip_gives_an_equal_result_and_equal_bytes(result: Result, tmp_path: Path) -> None:
    save_result(result, tmp_path / "result.json")
    loaded = load_result(tmp_path / "result.json")
    assert as_value(loaded) == as_value(frozen(result))
    assert encode(loaded) == (tmp_path / "result.json").read_bytes()


@pytest.mark.parametrize("conflicts", [(), [(0, 1)]])
def test_results_of_solve_round_trip(conflicts: list[tuple[int, int]], tmp_path: Path) -> None:
    result = solve(Instance.of([[0.6, 0.6]], required=0.8, conflicts=conflicts), backend="highs", time=60)
    save_result(result, tmp_path / "result.json")
    assert as_value(load_result(tmp_path / "result.json")) == as_value(frozen(result))


def test_what_is_infinite_is_null() -> None:
    document = json.loads(encode(UNBOUNDED))
    assert document["bound"] is None
    document = json.loads(encode(INFEASIBLE))
    assert (document["settings"]["time"], document["bound"], document["trace"][0]["objective"]) == (None, "inf", None)


@pytest.mark.parametrize(
    "wrong",
    [
        replace(FULL, bound=math.nan),
        replace(FULL, value=(math.nan,)),
        replace(FULL, trace=(Progress(seconds=0, objective=-math.inf, bound=0),)),
        replace(FULL, coverage=np.array([np.nan])),
        replace(FULL, message="\ud800"),
        replace(FULL, digest="short"),
    ],
)
def test_results_that_could_not_be_read_again_are_not_written(wrong: Result, tmp_path: Path) -> None:
    with pytest.raises(InvalidResult):
        save_result(wrong, tmp_path / "result.json")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("schema", "pscover.instance/1", "$.schema: expected 'pscover.result/1', got \"pscover.instance/1\""),
        ("status", "great", "$.status: Invalid enum value 'great', got \"great\""),
        ("chosen", [2, 0], "$.chosen: expected candidates that rise strictly, got another order"),
        ("chosen", [0, 0], "$.chosen: expected candidates that rise strictly, got another order"),
        ("chosen", [-1], "$.chosen[0]: expected int >= 0, got -1"),
        ("chosen", [0.5], "$.chosen[0]: expected int, got 0.5"),
        ("chosen", None, "$.chosen: expected a plan and its value, as the status is feasible, got none"),
        ("value", [], "$.chosen: expected a plan and its value, as the status is feasible, got none"),
        ("value", [None], "$.value[0]: expected float, got null"),
        ("coverage", None, "$.coverage: expected coverage and shortfall of the plan, got none"),
        ("coverage", [1.5], "$.coverage[0]: expected float <= 1.0, got 1.5"),
        ("bound", "low", "$.bound: Invalid enum value 'low', got \"low\""),
        ("digest", "abc", "$.digest: expected str matching regex '^[0-9a-f]{64}$', got \"abc\""),
        ("settings.time", -1, "$.settings.time: expected a positive number of seconds, got -1.0"),
        ("settings.threads", 0, "$.settings.threads: expected a whole number from 1 to 256, got 0"),
        ("settings.seed", 10**40, "$.settings.seed: expected a whole number from 0 to 2^31 - 1, got 1"),
        ("trace", [{}], "$.trace[0]: expected the field 'seconds', got an object without it"),
        ("timing.total", "x", '$.timing.total: expected float, got "x"'),
        ("versions", [["a"]], '$.versions[0]: expected array of length 2, got ["a"]'),
        ("more", 1, '$: expected only fields of this schema, got "more"'),
    ],
)
def test_wrong_values_are_told_with_path_expected_and_got(path: str, value: Any, message: str) -> None:
    document = json.loads(encode(FULL))
    *parents, last = path.split(".")
    node = document
    for key in parents:
        node = node[key]
    node[last] = value
    with pytest.raises(InvalidResult) as caught:
        decode(json.dumps(document).encode(), "result.json")
    assert str(caught.value).startswith(f"result.json: {message}")


def test_repeated_keys_truncated_and_missing_files(tmp_path: Path) -> None:
    path = tmp_path / "result.json"
    with pytest.raises(InvalidResult, match="there is no such file"):
        load_result(path)
    whole = encode(FULL)
    path.write_bytes(whole.replace(b'"backend"', b'"backend": "", "backend"'))
    with pytest.raises(InvalidResult, match="expected each key of an object once"):
        load_result(path)
    for length in range(0, len(whole) - 2, 53):
        path.write_bytes(whole[:length])
        with pytest.raises(InvalidResult, match=r"result\.json"):
            load_result(path)


def test_an_existing_file_survives_a_result_that_cannot_be_written(tmp_path: Path) -> None:
    save_result(FULL, tmp_path / "result.json")
    with pytest.raises(PscoverError):
        save_result(replace(FULL, bound=math.nan), tmp_path / "result.json")
    assert as_value(load_result(tmp_path / "result.json")) == as_value(frozen(FULL))
