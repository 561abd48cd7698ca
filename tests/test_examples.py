"""The examples run, and the served planner answers whatever it is sent."""

from __future__ import annotations

import importlib.util
import io
import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
pytestmark = pytest.mark.skipif(not EXAMPLES.is_dir(), reason="the examples are not here")
cv2 = pytest.importorskip("cv2")
pytest.importorskip("skimage")


def load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"example_{name}", EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("policy", ["segment", "random", "consolidation"])
def test_an_arm_of_ones_own_clears_the_table(policy: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert load("own_arm").main(policy) == 0
    assert "clear after" in capsys.readouterr().out


def served(*requests: object) -> list[dict[str, Any]]:
    lines = [request if isinstance(request, str) else json.dumps(request) for request in requests]
    answers = io.StringIO()
    load("json_lines").serve(io.StringIO("\n".join(lines) + "\n"), answers)
    return [json.loads(line) for line in answers.getvalue().splitlines()]


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    rgb = np.full((120, 200, 3), 210, dtype=np.uint8)
    rgb[30:80, 30:80], rgb[40:90, 120:170] = (180, 30, 30), (20, 20, 160)
    cv2.imwrite(str(tmp_path / "frame.png"), rgb[:, :, ::-1])
    depth = np.full((120, 200), 1.3)
    depth[30:80, 30:80], depth[40:90, 120:170] = 1.28, 1.26
    np.save(tmp_path / "frame.npy", depth)
    return tmp_path / "frame.png"


def test_plans_and_trips_are_served(photo: Path) -> None:
    labels = np.zeros((60, 120), dtype=int)
    labels[10:50, 10:50], labels[10:50, 70:110] = 1, 2
    ask = {"do": "next", "policy": "segment", "image": str(photo)}
    depth = {"do": "next", "policy": "height", "image": str(photo), "depth": str(photo.with_suffix(".npy"))}
    answers = served(
        {"id": 1, "do": "plan", "labels": labels.tolist(), "time": 5},
        {"id": 2, "do": "plan", "image": str(photo), "required": 0.6},
        {"id": 3, **ask},
        {"id": 4, **ask},
        {"do": "reset"},
        {"id": 5, **ask},
        {"id": 6, **depth},
        {"id": 7, "do": "policies"},
        {"do": "quit"},
        {"id": 8, "do": "policies"},
    )
    assert [answer["id"] for answer in answers] == [1, 2, 3, 4, None, 5, 6, 7]
    assert all(answer["ok"] for answer in answers), answers
    assert len(answers[0]["plan"]["grasps"]) == 2
    assert len(answers[1]["plan"]["garments"]) == 2
    assert [answer["planned"] for answer in (answers[2], answers[3], answers[5])] == [True, False, True]
    assert [action["action"] for action in answers[2]["actions"]] == ["pick", "transport"]
    assert answers[6]["actions"][0]["x"] >= 120
    assert "segment" in answers[7]["policies"]


@pytest.mark.parametrize(
    ("request_", "error"),
    [
        ("{", "expected a JSON object on one line"),
        ("[" * 10_000, "expected a JSON object on one line"),
        ("7", "expected a JSON object, got int"),
        ("{}", "do: expected"),
        ({"do": "dance"}, 'got "dance"'),
        ({"do": "plan"}, 'either "image" or "labels"'),
        ({"do": "plan", "labels": [[1, 1], [1]]}, "all of one length"),
        ({"do": "plan", "labels": [["a"]]}, "labels"),
        ({"do": "plan", "labels": []}, "labels"),
        ('{"do": "plan", "labels": [[1]], "time": NaN}', "no number NaN"),
        ('{"do": "plan", "labels": [[1]], "pixels_per_cm": 1e999}', "ordinary size"),
        ('{"do": "plan", "labels": [[1]], "time": 1' + "0" * 400 + "}", "ordinary size"),
        ('{"do": "policies", "id": 1e999}', "id: expected"),
        ({"do": "plan", "labels": [[1]], "time": "long"}, 'time: expected a number, got "long"'),
        ({"do": "plan", "labels": [[1]], "tiem": 3}, "unknown name 'tiem'"),
        ({"do": "plan", "labels": [[1]], "backend": "higs"}, "did you mean 'highs'"),
        ({"do": "plan", "labels": [[1]], "required": 2}, "required"),
        ({"do": "plan", "labels": [[1]], "seed": -1}, "seed"),
        ({"do": "plan", "labels": [[1]], "basket": [1]}, "basket: expected [x, y]"),
        ({"do": "plan", "image": "/nowhere.png"}, "no such file"),
        ({"do": "next", "policy": "segmnet", "image": "x"}, "did you mean 'segment'"),
        ({"do": "next", "policy": "segment", "image": "x", "settings": {"pionts": 3}}, "did you mean 'points'"),
        ({"do": "next", "policy": "segment", "image": "x", "settings": []}, '"settings"'),
        ({"do": "next", "policy": "segment", "image": "x", "failed": [None]}, "failed: expected [x, y], got null"),
        ({"do": "next", "policy": "segment"}, "image: expected text, got null"),
    ],
)
def test_bad_requests_get_one_line_and_the_next_is_answered(request_: object, error: str) -> None:
    bad, good = served(request_, {"id": 9, "do": "policies"})
    assert not bad["ok"]
    assert error in bad["error"]
    assert "Traceback" not in bad["error"]
    assert good["ok"]


def test_the_program_writes_answers_and_nothing_else(photo: Path) -> None:
    requests = ["nonsense", json.dumps({"id": 1, "do": "next", "policy": "height", "image": str(photo)}), '{"do": "quit"}']
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / "json_lines.py")],
        input=b"\xff\xfe\n" + "\n".join(requests).encode(), capture_output=True, check=True,
    )  # fmt: skip
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    assert [answer["ok"] for answer in answers] == [False, False, False]
    assert "expected depth" in answers[2]["error"]
    assert done.stderr == b""
